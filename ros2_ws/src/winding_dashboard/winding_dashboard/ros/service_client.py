"""Calls the graph's services for the page: the rig's commands, lifecycles, parameters."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from rclpy.node import Node
from std_srvs.srv import SetBool

from winding_core.cable.cases import Case
from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.parameters import ParameterError, build, declarations
from winding_core.status import PLAYER, REFUSED_TRANSITION
from winding_dashboard.page import commands
from winding_dashboard.page.commands import Choice, CommandError
from winding_dashboard.state.health import SILENCE, Health
from winding_ros import services, topics
from winding_ros.client.async_client import ServiceCaller
from winding_ros.client.lifecycle import LifecycleDriver
from winding_ros.graph import GRAPH, GraphError, controlled, without_replay
from winding_ros.message_guard import subscribers_of
from winding_ros.services import Service

Record = TypeVar("Record")
NODES = tuple(spec.name for spec in GRAPH)
_CONTROLLED = tuple(spec.name for spec in controlled())
# A command has the name of its service.
_COMMANDS: dict[str, Service] = {name: getattr(services, name.upper()) for name in commands.TITLES}
# Nodes that publish a recording: `winding bag play` and `ros2 bag play`.
_PLAYERS = (PLAYER, "rosbag2_player")
_ANSWER = 3.0
_QUICK = 0.9
_TAKE_UP = "take_up_material"
_LAY, _MEASURED_LAY, _OWN_LAY = "lay", "paper", "fem"
# Discovery takes a second on a busy machine; readers of other tools may never come back.
_MATCHING = 10.0
_LOOK = 0.1
_CLOSING = 120.0  # A large bag on a slow disk


@dataclass(eq=False)
class ServiceClient:
    """The graph as the page commands it (`commands.Graph`).

    What a node refuses, or does not answer in time, is a CommandError.
    """

    node: Node  # A node that an executor spins
    wake: Callable[[], None]  # Tells the executor that the node has further clients
    health: Health  # What the nodes report
    clock: Callable[[], float]  # Wall time [s] as `health` gets it
    # Names of the graph's nodes in the order of activation; empty for those of a simulated machine
    nodes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self._namespace = self.node.get_namespace()
        self._first_lay: str | None = None
        self._calls = ServiceCaller(self.node, self.wake)
        self._driver = LifecycleDriver(self._calls, self._namespace, self._refusal)
        # A player belongs to no graph.
        self._player = LifecycleDriver(self._calls, "", self._refusal)

    def unavailable(self, command: str) -> str:
        """Return why a command cannot be given now; empty when it can."""
        return self._unserved(self._service(command))

    def unprepared(self) -> str:
        """Return why no other case can be chosen now; empty when it can."""
        if self._driven_elsewhere:
            return "the machine has a driver of its own; another condition takes another run"
        return self._driver.unserved(self._nodes)

    async def command(self, command: str) -> str:
        """Give a command to the machine or to the controller of the lay; return its answer.

        Raises:
            CommandError: It was refused, or not answered in time.
        """
        service = self._service(command)
        emergency = command == commands.EMERGENCY_STOP
        try:
            return await self._ask(service, service.type.Request(), _ANSWER, retry=emergency)
        except TimeoutError as error:
            advice = ": use the machine's own button" if emergency else ""
            raise CommandError(f"{error}{advice}") from None

    async def choice(self) -> Choice:
        """Return what the solver is set to wind."""
        condition, got = await self._solver(Condition, _TAKE_UP)
        return Choice(condition=condition, take_up=bool(got[_TAKE_UP]))

    async def prepare(self, choice: Choice, report: Callable[[str], None]) -> str:
        """Set a choice on every node, bring all nodes up and wait until they hear each other.

        Returns:
            What the operator should know of it, or nothing.
        """
        condition = asdict(choice.condition)
        nodes = self._nodes
        values: dict[str, dict[str, object]] = {name: dict(condition) for name in nodes}
        values[topics.FEM] |= {_TAKE_UP: choice.take_up}
        for name, fresh in without_replay().items():
            values[name] |= fresh
        async with _as_commands():
            values[topics.RIG] |= await self._lay(choice.condition.resolved().case)
            before = self._readers()
            await self._driver.rebuild(nodes, values, report)
        report("waiting until the nodes hear each other")
        return await self._heard_by(before)

    def player(self) -> str | None:
        """Return which node plays a recording in the machine's place.

        Empty where a machine can be commanded, None where neither is known.
        """
        if any(not self._unserved(service) for service in (services.START, services.STOP)):
            return ""
        publishers = {
            info.node_name
            for topic in (topics.JOINT_STATES, topics.FEM_MARKERS, topics.TRACKED_MARKERS)
            for info in self._calls.node.get_publishers_info_by_topic(topic.name)
        }
        return next((name for name in _PLAYERS if name in publishers), None)

    def unrecorded(self) -> str:
        """Return why the recording cannot be switched now; empty when it can."""
        missing = self._unserved(services.RECORD)
        return f"{missing}; `winding run --dashboard` does" if missing else ""

    async def record(self, on: bool) -> str:
        """Begin a recording or end it."""
        request = services.RECORD.type.Request(data=on)
        async with _as_commands():
            return await self._ask(services.RECORD, request, _CLOSING)

    async def renew(self) -> str:
        """Let the listeners begin a new run, unless the reset has done so."""
        if self._driven_elsewhere:
            return ""
        async with _as_commands():
            await self._driver.renew(name for name in self._nodes if name != topics.RIG)
        return "the machine and its watchers stand at the start of a run"

    async def play(self, *, position: float | None = None, paused: bool | None = None) -> str:
        """Go to a place of the recording that is played [s], or pause it or go on."""
        async with _as_commands():
            if position is not None:
                await self._player.set_parameters(PLAYER, {"position": position})
            if paused is not None:
                request = SetBool.Request(data=paused)
                await self._calls.call(SetBool, f"/{PLAYER}/set_paused", request, _ANSWER)
        return ""

    async def axes(self) -> MachineAxes | None:
        """Return how the solver reads the machine's axes; None for a simulated machine."""
        return (await self._solver(MachineAxes))[0] if self._driven_elsewhere else None

    async def lifecycle(self) -> dict[str, str]:
        """Return the state of every node that answers, by name."""
        nodes = self._nodes
        states = await asyncio.gather(*(self._state(name) for name in nodes))
        return {name: state for name, state in zip(nodes, states, strict=True) if state}

    async def _solver(self, record: type[Record], *more: str) -> tuple[Record, dict[str, object]]:
        """Return a record of the solver's parameters, and the values of further ones."""
        names = [item.name for item in declarations(record)]
        async with _as_commands():
            got = await self._driver.parameters(topics.FEM, [*names, *more])
        try:
            kept = {name: got[name] for name in names if name in got}
            return build(record, kept, owner=topics.FEM), got
        except ParameterError as error:
            raise CommandError(f"{topics.FEM}: {error}") from error

    @property
    def _driven_elsewhere(self) -> bool:
        """Whether the machine has a driver of its own, which no condition is set on."""
        return topics.RIG not in self._nodes

    def _service(self, command: str) -> Service:
        """Return what is called; the orchestrator resets a machine with a driver of its own."""
        if command == commands.RESET and self._driven_elsewhere:
            return services.NEXT_RUN
        return _COMMANDS[command]

    @property
    def _nodes(self) -> tuple[str, ...]:
        """The graph's nodes in the order of activation, the lay's controller if it is there."""
        if self.nodes:
            return self.nodes
        heard = self.health.silent_for(topics.LAY_CONTROL, self.clock()) <= SILENCE
        there = heard or not self._driver.unserved([topics.LAY_CONTROL])
        return _CONTROLLED if there else NODES

    def _unserved(self, service: Service) -> str:
        if self._calls.ready(service.type, service.name):
            return ""
        return f"no node serves {service.name} in {self._namespace}"

    async def _ask(
        self, service: Service, request: Any, timeout: float, *, retry: bool = False
    ) -> str:
        response = await self._calls.call(service.type, service.name, request, timeout, retry=retry)
        if not response.success:
            raise CommandError(response.message or f"{service.name} was refused")
        return str(response.message)

    async def _lay(self, case: Case) -> dict[str, object]:
        """Return where a simulated machine lays the cable; a real one is not asked.

        A condition without published markers can only be laid by the model with hidden properties.
        """
        lay = (await self._driver.parameters(topics.RIG, [_LAY])).get(_LAY)
        if lay is None:
            return {}
        self._first_lay = self._first_lay or str(lay)
        measured = self._first_lay == _MEASURED_LAY and not case.is_published
        return {_LAY: _OWN_LAY if measured else self._first_lay}

    def _readers(self) -> dict[str, int]:
        """Return how many subscribers the nodes' publishers report, by topic."""
        found: dict[str, int] = {}
        for node in self._nodes:
            found |= subscribers_of(self.health.values(f"{node}: topics"))
        return found

    async def _heard_by(self, before: Mapping[str, int]) -> str:
        """Wait until every topic has as many readers as before; return what is missing."""
        begin = self.clock()
        while (now := self.clock()) - begin < _MATCHING:
            reported = all(self.health.silent_for(node, now) < now - begin for node in self._nodes)
            present = self._readers()
            missing = [name for name, count in before.items() if present.get(name, 0) < count]
            if reported and not missing:
                return ""
            await asyncio.sleep(_LOOK)
        return f"{missing[0]} has fewer readers than before" if missing else ""

    async def _refusal(self, node: str) -> str:
        """Return a node's reason for a refused transition, which it reports within a second."""
        begin = self.clock()
        while (now := self.clock()) - begin < _ANSWER:
            refused = REFUSED_TRANSITION in self.health.values(node)
            if self.health.silent_for(node, now) < now - begin and refused:
                return self.health.message(node)
            await asyncio.sleep(_LOOK)
        return "refused; see the list of nodes"

    async def _state(self, node: str) -> str:
        if self._driver.unserved([node]):
            return ""
        try:
            return str((await self._driver.state(node, _QUICK)).label)
        except TimeoutError:
            return "no answer"


@asynccontextmanager
async def _as_commands() -> AsyncIterator[None]:
    """Turn what a node refuses or leaves unanswered into a sentence for the operator."""
    try:
        yield
    except (GraphError, TimeoutError) as error:
        raise CommandError(str(error)) from None
