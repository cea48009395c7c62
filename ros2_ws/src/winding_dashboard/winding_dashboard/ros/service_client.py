"""Calls the graph's services for the page: the rig's commands, lifecycles, parameters."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import SetBool, Trigger

from winding_core.cases import Case
from winding_core.condition import Condition
from winding_core.parameters import ParameterError, build, declarations
from winding_dashboard.views import commands
from winding_dashboard.views.commands import Choice, CommandError
from winding_dashboard.views.health import Health
from winding_ros import services, topics
from winding_ros.topic_status import subscribers_of

# Listeners first, the machine last, as the orchestrator activates them.
NODES = (topics.CORRECTION, topics.FEM, topics.TRACKER, topics.RIG)
_LISTENERS = NODES[:-1]
_RIG_COMMANDS = (commands.START, commands.STOP, commands.RESET, commands.EMERGENCY_STOP)
_TRANSITIONS = {
    "configure": Transition.TRANSITION_CONFIGURE,
    "activate": Transition.TRANSITION_ACTIVATE,
    "deactivate": Transition.TRANSITION_DEACTIVATE,
    "cleanup": Transition.TRANSITION_CLEANUP,
}
_ANSWER = 3.0
_QUICK = 0.9
# Kernels may be compiled in between.
_TRANSITION = 300.0
_EMERGENCY_REPEAT = 0.5
_TAKE_UP = "take_up_material"
_CANNOT = "cannot "
_LAY, _OWN_LAY = "lay", "fem"
# Discovery takes a second on a busy machine; readers of other tools may never come back.
_MATCHING = 10.0
_LOOK = 0.1
# A large bag on a slow disk.
_CLOSING = 120.0


def readers(health: Health, nodes: Sequence[str]) -> dict[str, int]:
    """Return how many subscribers the nodes' publishers say they have, by topic."""
    found: dict[str, int] = {}
    for node in nodes:
        found |= subscribers_of(health.values(f"{node}: topics"))
    return found


class ServiceClient:
    """The graph as the page commands it (`commands.Graph` and `commands.Lifecycle`).

    Args:
        node: A node that an executor spins.
        wake: Tells the executor that the node has further clients.
        health: What the nodes say of themselves.
        clock: Wall time [s] as `health` gets it.
    """

    def __init__(
        self,
        node: Node,
        wake: Callable[[], None],
        health: Health,
        clock: Callable[[], float],
    ) -> None:
        self._namespace = node.get_namespace()
        self._health = health
        self._clock = clock
        self._first_lay: str | None = None
        self._recorder = services.RECORD.client(node)
        self._rig = {name: node.create_client(Trigger, f"rig/{name}") for name in _RIG_COMMANDS}
        self._services = {
            (name, service): node.create_client(type_, f"{name}/{service}")
            for name in NODES
            for service, type_ in (
                ("get_state", GetState),
                ("change_state", ChangeState),
                ("get_parameters", GetParameters),
                ("set_parameters_atomically", SetParametersAtomically),
            )
        }
        wake()

    def unavailable(self, command: str) -> str:
        """Return why a command cannot be given now; empty when it can."""
        if self._rig[command].service_is_ready():
            return ""
        return f"nobody serves rig/{command} in {self._namespace}"

    def unprepared(self) -> str:
        """Return why no other case can be chosen now; empty when it can."""
        for (name, service), client in self._services.items():
            if not client.service_is_ready():
                return f"{name} does not serve {service} in {self._namespace}"
        return ""

    async def command(self, command: str) -> str:
        """Give one of the rig's commands; return its answer.

        Raises:
            CommandError: The rig refused, or did not answer in time.
        """
        client, request = self._rig[command], Trigger.Request()
        if command == commands.EMERGENCY_STOP:
            response = await self._insist(client, request)
        else:
            response = await self._call(client, request, _ANSWER)
        if not response.success:
            raise CommandError(response.message or f"rig/{command} was refused")
        return str(response.message)

    async def choice(self) -> Choice:
        """Return what the solver is set to wind.

        Raises:
            CommandError: It does not answer, or with something else.
        """
        names = [item.name for item in declarations(Condition)]
        got = await self._parameters(topics.FEM, [*names, _TAKE_UP])
        take_up = bool(got.pop(_TAKE_UP))
        try:
            return Choice(condition=build(Condition, got, owner=topics.FEM), take_up=take_up)
        except ParameterError as error:
            raise CommandError(f"{topics.FEM}: {error}") from error

    async def prepare(self, choice: Choice, tell: Callable[[str], None]) -> str:
        """Set a choice on every node, bring all nodes up and wait until they hear each other."""
        condition = asdict(choice.condition)
        values: dict[str, dict[str, object]] = {name: dict(condition) for name in NODES}
        values[topics.FEM] |= {_TAKE_UP: choice.take_up}
        values[topics.RIG] |= await self._lay(choice.condition.resolved().case)
        before = readers(self._health, NODES)
        await commands.prepare(self, NODES, values, tell)
        tell("waiting until the nodes hear each other")
        return await self._heard_by(before)

    async def _lay(self, case: Case) -> dict[str, object]:
        """Return where a simulated machine lays the cable; a real one is not asked.

        What nobody published can only be laid by the model with hidden properties.
        """
        lay = (await self._parameters(topics.RIG, [_LAY])).get(_LAY)
        if lay is None:
            return {}
        self._first_lay = self._first_lay or str(lay)
        return {_LAY: self._first_lay if case.is_published else _OWN_LAY}

    async def _heard_by(self, before: Mapping[str, int]) -> str:
        """Wait until every topic has as many readers as before; return what is missing."""
        begin = self._clock()
        while (now := self._clock()) - begin < _MATCHING:
            told = all(self._health.silent_for(node, now) < now - begin for node in NODES)
            present = readers(self._health, NODES)
            missing = [name for name, count in before.items() if present.get(name, 0) < count]
            if told and not missing:
                return ""
            await asyncio.sleep(_LOOK)
        return f"{missing[0]} has fewer readers than before" if missing else ""

    async def _parameters(self, node: str, names: Sequence[str]) -> dict[str, object]:
        got = await self._call(
            self._services[node, "get_parameters"], GetParameters.Request(names=names), _ANSWER
        )
        return {
            name: parameter_value_to_python(value)
            for name, value in zip(names, got.values, strict=False)
        }

    def unrecorded(self) -> str:
        """Return why the recording cannot be switched now; empty when it can."""
        if self._recorder.service_is_ready():
            return ""
        name = services.RECORD.name
        return f"nobody serves {name} in {self._namespace}; `winding run --dashboard` does"

    async def record(self, on: bool) -> str:
        """Begin a recording or end it.

        Raises:
            CommandError: The recorder refused, or did not answer in time.
        """
        response = await self._call(self._recorder, SetBool.Request(data=on), _CLOSING)
        if not response.success:
            raise CommandError(response.message or f"{services.RECORD.name} was refused")
        return str(response.message)

    async def renew(self) -> None:
        """Let the listeners begin a new run."""
        await commands.renew(self, _LISTENERS)

    async def lifecycle(self) -> dict[str, str]:
        """Return the state of every node that answers, by name."""
        states = await asyncio.gather(*(self._quick_state(name) for name in NODES))
        return {name: state for name, state in zip(NODES, states, strict=True) if state}

    async def state(self, node: str) -> str:
        """Return the node's lifecycle state."""
        response = await self._call(
            self._services[node, "get_state"], GetState.Request(), _TRANSITION
        )
        return str(response.current_state.label)

    async def change(self, node: str, transition: str) -> None:
        """Ask for a transition and wait for its end.

        Raises:
            CommandError: The node refused, or did not answer in time.
        """
        request = ChangeState.Request(transition=Transition(id=_TRANSITIONS[transition]))
        response = await self._call(self._services[node, "change_state"], request, _TRANSITION)
        if not response.success:
            raise CommandError(f"{node} {await self._refusal(node, transition)}")

    async def _refusal(self, node: str, transition: str) -> str:
        """Return what a node says of a refused transition; it says so within a second."""
        begin = self._clock()
        while (now := self._clock()) - begin < _ANSWER:
            said = self._health.message(node)
            if self._health.silent_for(node, now) < now - begin and said.startswith(_CANNOT):
                return said
            await asyncio.sleep(_LOOK)
        return f"refused to {transition}; the list of nodes says why"

    async def set_parameters(self, node: str, values: Mapping[str, object]) -> None:
        """Set parameters all at once.

        Raises:
            CommandError: The node refused, or did not answer in time.
        """
        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
            ]
        )
        response = await self._call(
            self._services[node, "set_parameters_atomically"], request, _ANSWER
        )
        if not response.result.successful:
            raise CommandError(f"{node}: {response.result.reason}")

    async def _quick_state(self, node: str) -> str:
        client = self._services[node, "get_state"]
        if not client.service_is_ready():
            return ""
        try:
            response = await self._call(client, GetState.Request(), _QUICK)
        except CommandError:
            return "no answer"
        return str(response.current_state.label)

    async def _insist(self, client: Any, request: Any) -> Any:
        """Repeat a request that may be repeated until somebody answers."""
        try:
            async with asyncio.timeout(_ANSWER):
                while True:
                    try:
                        return await self._call(client, request, _EMERGENCY_REPEAT)
                    except CommandError:
                        continue
        except TimeoutError:
            raise CommandError(
                f"no answer from {client.srv_name} in {_ANSWER:g} s: use the machine's own button"
            ) from None

    async def _call(self, client: Any, request: Any, timeout: float) -> Any:
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[Any] = loop.create_future()
        pending = client.call_async(request)

        def hand_over(done: Any) -> None:
            def settle() -> None:
                if not answer.done():
                    answer.set_result(done.result())

            loop.call_soon_threadsafe(settle)

        pending.add_done_callback(hand_over)
        try:
            return await asyncio.wait_for(answer, timeout)
        except TimeoutError:
            client.remove_pending_request(pending)
            raise CommandError(f"no answer from {client.srv_name} in {timeout:g} s") from None
