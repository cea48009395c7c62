"""A node that somebody else started, such as a container: known by what it says alone."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import fields

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from winding_ros.async_client import AsyncClient
from winding_ros.graph import NodeSpec, parameters_of

_ANSWER_TIMEOUT = 30.0
# What leads back to unconfigured.
_BACK = {
    State.PRIMARY_STATE_ACTIVE: Transition.TRANSITION_DEACTIVATE,
    State.PRIMARY_STATE_INACTIVE: Transition.TRANSITION_CLEANUP,
}


class AttachedNode:
    """Answers as a NodeProcess does, without a process: nobody here can start or end it.

    Args:
        spec: Which node.
        client: Calls its services.
        name: Full name.
        parameters: What it is to be run with.
    """

    def __init__(
        self, spec: NodeSpec, client: AsyncClient, name: str, parameters: Mapping[str, object]
    ) -> None:
        self.spec = spec
        self.started = False
        self.return_code: int | None = None
        # Without its process to look at, silence is all there is to tell a hang by.
        self.stopped = True
        self._client = client
        self._name = name
        self._parameters = dict(parameters)
        self._declared = {field.name for field in fields(parameters_of(spec))} | {"use_sim_time"}

    @property
    def pid(self) -> int:
        """Always refused: its process id is of another machine's.

        Raises:
            ProcessLookupError: Always.
        """
        raise ProcessLookupError(f"{self._name} runs elsewhere")

    async def start(self) -> None:
        """Leave the start to whoever runs the node; its services are waited for."""

    async def ended(self) -> int:
        """Wait for ever: the end of a process elsewhere shows in its signs of life alone."""
        never: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        return await never

    async def kill(self) -> int:
        """Leave the process alone."""
        return 0

    async def stop(self) -> int:
        """Leave the process alone; a node let go of waits for the next run."""
        return 0

    async def refusal(self, patience: float) -> str:
        """Return where the reason is found: the output of a node elsewhere is not read here."""
        return "refused; its own output says why"

    def complaint(self) -> str:
        """Return nothing: the output is elsewhere."""
        return ""

    async def take_parameters(self) -> str:
        """Bring the node to unconfigured and give it its parameters; return why it refused."""
        await self.let_go()
        unknown = sorted(set(self._parameters) - self._declared)
        if unknown:
            return f"there is no parameter {unknown[0]!r}"
        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in self._parameters.items()
            ]
        )
        answer = await self._client.call(
            SetParametersAtomically,
            f"{self._name}/set_parameters_atomically",
            request,
            _ANSWER_TIMEOUT,
        )
        return "" if answer.result.successful else str(answer.result.reason)

    async def let_go(self) -> None:
        """Bring the node back to unconfigured, from wherever it is.

        Raises:
            TimeoutError: It does not answer.
        """
        async with asyncio.timeout(_ANSWER_TIMEOUT):
            while (step := _BACK.get(await self._state())) is not None:
                await self._client.try_call(
                    ChangeState,
                    f"{self._name}/change_state",
                    ChangeState.Request(transition=Transition(id=step)),
                    _ANSWER_TIMEOUT,
                )

    async def _state(self) -> int:
        answer = await self._client.call(
            GetState, f"{self._name}/get_state", GetState.Request(), _ANSWER_TIMEOUT
        )
        return int(answer.current_state.id)
