"""Drives nodes from one lifecycle state to another, through lost answers and refusals."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python

from winding_ros.client.async_client import ServiceCaller
from winding_ros.graph import GraphError


@asynccontextmanager
async def deadline(
    timeout: float, sentence: str, work: Callable[[], object] = lambda: None
) -> AsyncIterator[None]:
    """Raise TimeoutError with a sentence when the body takes too long.

    Args:
        timeout: How long the body may take while nothing works for it [s].
        sentence: Of the error.
        work: Returns what changes while work goes on; each change begins the time anew, so that
            a slow computer is no reason to give up.
    """

    async def look(limit: asyncio.Timeout) -> None:
        before = work()
        while True:
            await asyncio.sleep(timeout / _LOOKS)
            if (now := work()) != before and not limit.expired():
                before = now
                limit.reschedule(asyncio.get_running_loop().time() + timeout)

    try:
        async with asyncio.timeout(timeout) as limit:
            looking = asyncio.create_task(look(limit))
            try:
                yield
            finally:
                looking.cancel()
    except TimeoutError:
        raise TimeoutError(sentence) from None


CONFIGURE = Transition.TRANSITION_CONFIGURE
ACTIVATE = Transition.TRANSITION_ACTIVATE
DEACTIVATE = Transition.TRANSITION_DEACTIVATE
CLEANUP = Transition.TRANSITION_CLEANUP
# A node that neither answers nor works for so long is given up [s].
START_TIMEOUT = 120.0
CONFIGURE_TIMEOUT = 300.0
_LOOKS = 20
# A transition without an answer for so long is looked after.
ANSWER_PATIENCE = 5.0
_ANSWER_TIMEOUT = 30.0
_GOALS = {
    CONFIGURE: State.PRIMARY_STATE_INACTIVE,
    ACTIVATE: State.PRIMARY_STATE_ACTIVE,
    DEACTIVATE: State.PRIMARY_STATE_INACTIVE,
    CLEANUP: State.PRIMARY_STATE_UNCONFIGURED,
}
_VERBS = {
    CONFIGURE: "configure",
    ACTIVATE: "activate",
    DEACTIVATE: "deactivate",
    CLEANUP: "clean up",
}
# What leads back to unconfigured.
_BACK = {State.PRIMARY_STATE_ACTIVE: DEACTIVATE, State.PRIMARY_STATE_INACTIVE: CLEANUP}
_SERVICES = {
    "get_state": GetState,
    "change_state": ChangeState,
    "get_parameters": GetParameters,
    "set_parameters_atomically": SetParametersAtomically,
}


@dataclass(eq=False)
class LifecycleDriver:
    """Lifecycle and parameters of a graph's nodes, as set from outside their processes."""

    calls: ServiceCaller  # Calls the nodes' services
    namespace: str  # Of the graph
    reason: Callable[[str], Awaitable[str]]  # Returns why a node refused a transition just now
    # Returns what changes while a node works; None where that is not known
    work: Callable[[str], object] = lambda node: None

    def __post_init__(self) -> None:
        self._namespace = f"/{self.namespace.strip('/')}".rstrip("/")

    def unserved(self, nodes: Iterable[str]) -> str:
        """Return which node cannot be driven now, as a sentence; empty when all can."""
        for node in nodes:
            for service, type_ in _SERVICES.items():
                if not self.calls.ready(type_, self._name(node, service)):
                    return f"{node} does not serve {service} in {self._namespace or '/'}"
        return ""

    async def first_state(self, node: str) -> State:
        """Return the lifecycle state of a node that has just started.

        Raises:
            TimeoutError: It neither answers nor works for START_TIMEOUT.
        """
        late = f"{node} has not answered since it was started {START_TIMEOUT:g} s ago"
        async with deadline(START_TIMEOUT, late, partial(self.work, node)):
            return await self.state(node, None)

    async def state(self, node: str, timeout: float | None = _ANSWER_TIMEOUT) -> State:
        """Return a node's lifecycle state.

        Raises:
            TimeoutError: It does not answer within timeout [s]; None waits without limit.
        """
        answer = await self._call(node, "get_state", GetState.Request(), timeout)
        return answer.current_state

    async def change(self, node: str, transition: int, timeout: float = CONFIGURE_TIMEOUT) -> None:
        """Ask for a transition until the node is where it leads.

        An answer can be lost while client and server find each other. Then the node's state
        tells what became of the request; it answers when the transition is over.

        Raises:
            GraphError: It refused.
            TimeoutError: It is not there, and has neither answered nor worked for timeout [s].
        """
        late = f"{node} does not {_VERBS[transition]}: no answer and no work in {timeout:g} s"
        async with deadline(timeout, late, partial(self.work, node)):
            while True:
                response = await self.request(node, transition, ANSWER_PATIENCE)
                if response is None:
                    if (await self.state(node, None)).id == _GOALS[transition]:
                        return
                elif response.success:
                    return
                else:
                    raise GraphError(f"{node}: {await self.reason(node)}")

    async def request(self, node: str, transition: int, timeout: float) -> Any | None:
        """Ask for a transition once; return the response, None without one in timeout [s]."""
        request = ChangeState.Request(transition=Transition(id=transition))
        return await self.calls.try_call(
            ChangeState, self._name(node, "change_state"), request, timeout
        )

    async def take_down(self, node: str) -> None:
        """Bring a node back to unconfigured, from wherever it is.

        Raises:
            GraphError, TimeoutError: As `change` does.
        """
        while (transition := _BACK.get((await self.state(node)).id)) is not None:
            await self.change(node, transition)

    async def renew(self, nodes: Iterable[str]) -> None:
        """Pause and resume the nodes that are active, so that they begin a new run.

        Raises:
            GraphError, TimeoutError: As `change` does.
        """
        for node in nodes:
            if (await self.state(node)).id == State.PRIMARY_STATE_ACTIVE:
                await self.change(node, DEACTIVATE)
                await self.change(node, ACTIVATE)

    async def rebuild(
        self,
        nodes: Sequence[str],
        values: Mapping[str, Mapping[str, object]],
        report: Callable[[str], None],
    ) -> None:
        """Take every node down, set its parameters, and bring all up again.

        Args:
            nodes: Their names in the order of activation: listeners first, the machine last.
            values: Parameters by node.
            report: Takes one sentence for each stage.

        Raises:
            GraphError: A node refused; those after it are left as they were.
            TimeoutError: A node does not answer.
        """
        report("taking the nodes down")
        for node in reversed(nodes):
            await self.take_down(node)
        for node in nodes:
            await self.set_parameters(node, values.get(node, {}))
        report("building the models; the prediction of the run takes some seconds")
        await asyncio.gather(*(self.change(node, CONFIGURE) for node in nodes))
        report("switching on")
        for node in nodes:
            await self.change(node, ACTIVATE)

    async def parameters(
        self, node: str, names: Sequence[str], timeout: float = _ANSWER_TIMEOUT
    ) -> dict[str, object]:
        """Return what parameters of a node are set to; those that it does not have are left out.

        Raises:
            TimeoutError: It does not answer.
        """
        request = GetParameters.Request(names=names)
        answer = await self._call(node, "get_parameters", request, timeout)
        return dict(zip(names, map(parameter_value_to_python, answer.values), strict=False))

    async def set_parameters(self, node: str, values: Mapping[str, object]) -> None:
        """Set parameters all at once.

        Raises:
            GraphError: The node refused them.
            TimeoutError: It does not answer.
        """
        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
            ]
        )
        answer = await self._call(node, "set_parameters_atomically", request, _ANSWER_TIMEOUT)
        if not answer.result.successful:
            raise GraphError(f"{node}: {answer.result.reason}")

    def _name(self, node: str, service: str) -> str:
        return f"{self._namespace}/{node}/{service}"

    async def _call(self, node: str, service: str, request: Any, timeout: float | None) -> Any:
        return await self.calls.call(
            _SERVICES[service], self._name(node, service), request, timeout
        )
