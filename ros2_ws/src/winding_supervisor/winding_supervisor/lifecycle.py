"""Drives nodes from one lifecycle state to another, through lost answers and refusals."""

from __future__ import annotations

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState

from winding_ros.async_client import AsyncClient
from winding_supervisor.attached_node import AttachedNode
from winding_supervisor.deadline import deadline
from winding_supervisor.graph_error import GraphError
from winding_supervisor.node_process import NodeProcess

Member = NodeProcess | AttachedNode

# First starts import torch and compile kernels on a busy machine.
START_TIMEOUT = 120.0
CONFIGURE_TIMEOUT = 300.0
# A transition without an answer for so long is looked after.
ANSWER_PATIENCE = 5.0
# The answer to a transition may overtake the sentence on the node's own output.
_REFUSAL_PATIENCE = 5.0
_FAREWELL_PATIENCE = 2.0
_GOALS = {
    Transition.TRANSITION_CONFIGURE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_ACTIVATE: State.PRIMARY_STATE_ACTIVE,
    Transition.TRANSITION_DEACTIVATE: State.PRIMARY_STATE_INACTIVE,
}


class LifecycleDriver:
    """The lifecycle of a graph's nodes, as somebody outside their processes drives it.

    Args:
        client: Calls their services.
        namespace: Of the graph, without slashes around it.
    """

    def __init__(self, client: AsyncClient, namespace: str) -> None:
        self._client = client
        self._namespace = namespace

    async def configure(self, member: Member) -> None:
        """Bring a node that has just started to inactive.

        Raises:
            GraphError: It refused, or is not what was started.
            TimeoutError: It does not answer.
        """
        state = await self._state(member, START_TIMEOUT)
        if isinstance(member, AttachedNode):
            refusal = await member.take_parameters()
            if refusal:
                raise GraphError(f"{member.spec.name}: {refusal}")
        elif state != State.PRIMARY_STATE_UNCONFIGURED:
            raise GraphError(
                f"{member.spec.name} is in state {state} before it was configured: "
                "another graph uses its name"
            )
        await self.change(member, Transition.TRANSITION_CONFIGURE, CONFIGURE_TIMEOUT)

    async def change(self, member: Member, transition: int, timeout: float) -> None:
        """Ask for a transition until the node is where it leads, for up to timeout [s].

        An answer can be lost while client and server find each other. Then the node's state
        tells what became of the request; it answers when the transition is over.

        Raises:
            GraphError: It refused.
            TimeoutError: It is not there in time.
        """
        request = ChangeState.Request(transition=Transition(id=transition))
        late = f"{member.spec.name} did not finish transition {transition} in {timeout:g} s"
        async with deadline(timeout, late):
            while True:
                response = await self._client.try_call(
                    ChangeState, self.service(member, "change_state"), request, ANSWER_PATIENCE
                )
                if response is None:
                    if await self._state(member, timeout) == _GOALS[transition]:
                        return
                elif response.success:
                    return
                else:
                    reason = await member.refusal(_REFUSAL_PATIENCE)
                    raise GraphError(f"{member.spec.name}: {reason}")

    async def ask_to_deactivate(self, member: Member) -> None:
        """Ask a node to pause, whether it answers or not."""
        await self._client.try_call(
            ChangeState,
            self.service(member, "change_state"),
            ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE)),
            _FAREWELL_PATIENCE,
        )

    def service(self, member: Member, name: str) -> str:
        """Return the full name of a node's service."""
        return f"/{self._namespace}/{member.spec.name}/{name}"

    async def _state(self, member: Member, timeout: float) -> int:
        response = await self._client.call(
            GetState, self.service(member, "get_state"), GetState.Request(), timeout
        )
        return int(response.current_state.id)
