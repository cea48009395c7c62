"""A node of the graph, with a process of its own or attached, and how it is brought up."""

import asyncio
import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

from lifecycle_msgs.msg import State

from winding_ros.client.lifecycle import CONFIGURE, LifecycleDriver, deadline
from winding_ros.graph import GraphError, NodeSpec, parameters_of
from winding_supervisor.processes.node_process import NodeProcess

_RETURN_TIMEOUT = 30.0


@dataclass(eq=False)
class AttachedNode:
    """A node that runs elsewhere, such as in a container: it is neither started nor ended here."""

    spec: NodeSpec  # Which node
    driver: LifecycleDriver  # Sets its state and its parameters
    parameters: Mapping[str, object]  # What it is to be run with
    started: ClassVar = False
    return_code: ClassVar[int | None] = None  # It does not end for this process
    # Without its process to look at, silence is the only sign of a hang.
    stopped: ClassVar = True
    wants_processor: ClassVar = False  # That is not seen from here

    @property
    def pid(self) -> int:
        """Always refused: its process id is of another machine's.

        Raises:
            ProcessLookupError: Always.
        """
        raise ProcessLookupError(f"{self.spec.name} runs elsewhere")

    async def start(self) -> None:
        """Leave the start to whoever runs the node; its services are waited for."""

    def work(self) -> object:
        """Return nothing: what a process elsewhere does is not seen here."""
        return None

    async def ended(self) -> int:
        """Wait for ever: the end of a process elsewhere shows in its signs of life alone."""
        never: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        return await never

    async def kill(self) -> int:
        """Leave the process alone."""
        return 0

    async def stop(self) -> int:
        """Leave the process alone; a detached node waits for the next run, unconfigured."""
        # One that has gone is not waited for.
        with contextlib.suppress(TimeoutError, GraphError):
            await self.let_go()
        return 0

    async def refusal(self, patience: float) -> str:
        """Return where the reason is found: the output of a node elsewhere is not read here."""
        return "refused; see its own output for the reason"

    def complaint(self) -> str:
        """Return nothing: the output is elsewhere."""
        return ""

    async def take_parameters(self) -> None:
        """Bring the node to unconfigured and give it its parameters.

        Raises:
            GraphError: It refused.
            TimeoutError: It does not answer.
        """
        await self.let_go()
        declared = {field.name for field in fields(parameters_of(self.spec))} | {"use_sim_time"}
        unknown = sorted(set(self.parameters) - declared)
        if unknown:
            raise GraphError(f"{self.spec.name}: there is no parameter {unknown[0]!r}")
        await self.driver.set_parameters(self.spec.name, self.parameters)

    async def let_go(self) -> None:
        """Bring the node back to unconfigured, from wherever it is.

        Raises:
            GraphError: It refused.
            TimeoutError: It does not answer.
        """
        late = f"{self.spec.name} did not go back to unconfigured in {_RETURN_TIMEOUT:g} s"
        async with deadline(_RETURN_TIMEOUT, late):
            await self.driver.take_down(self.spec.name)


Member = NodeProcess | AttachedNode


async def configure(driver: LifecycleDriver, member: Member) -> None:
    """Bring a node that has just started to inactive.

    Raises:
        GraphError: It refused, or is not what was started.
        TimeoutError: It does not answer.
    """
    name = member.spec.name
    state = await driver.first_state(name)
    if isinstance(member, AttachedNode):
        await member.take_parameters()
    elif state.id != State.PRIMARY_STATE_UNCONFIGURED:
        raise GraphError(
            f"{name} is in state {state.id} before it was configured: another graph uses its name"
        )
    await driver.change(name, CONFIGURE)


def exit_error(member: Member) -> GraphError:
    """Return the error that names a node that ended by itself, with the last line of its output."""
    cause = member.complaint()
    return GraphError(
        f"{member.spec.name} ended with exit code {member.return_code}"
        + (f": {cause}" if cause else "")
    )
