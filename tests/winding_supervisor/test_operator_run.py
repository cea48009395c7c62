"""An operator's run: where it begins, who subscribes beside the graph, and the page's process."""

import asyncio
import math
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from axis_readings import axis_reading
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from processes import free_port
from winding_core.run_options import OperatorLimits
from winding_core.run_outcome import Cause, EndedBy
from winding_core.status import Status
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.client.lifecycle import LifecycleDriver
from winding_ros.environment import set_process_environment
from winding_ros.graph import GraphError
from winding_ros.messages.rig import encode_joint_state
from winding_supervisor.processes.discovery import outsiders
from winding_supervisor.session.dashboard_process import DashboardConfig, DashboardProcess
from winding_supervisor.session.rig_conduct import RigConduct, RunStart
from winding_supervisor.watch.event_log import EventLog, read_events

NAMESPACE = "attended"
SPEED = 1.74
PATIENCE = 120.0


class Machine:
    """Encoder samples as a buffer has them: 1 kHz, each taken a millisecond after the other."""

    def __init__(self) -> None:
        self.buffer = RunBuffer([topics.JOINT_STATES, topics.FEM_PREDICTION])
        self.wall_ns = 10**12

    def wind(self, begin: float, samples: int, angle: float = 0.0) -> None:
        """Wind on from a simulated time [s] and an angle [rad]."""
        for k in range(samples):
            t = begin + 1e-3 * k
            reading = axis_reading(angle + SPEED * 1e-3 * k, speed=SPEED, feed=0.005)
            self._buffer(topics.JOINT_STATES, t, encode_joint_state(t, reading))

    def predict(self) -> None:
        self._buffer(topics.FEM_PREDICTION, 0.0, encode_joint_state(0.0, _STANDING))

    def wait(self, seconds: float) -> None:
        self.wall_ns += round(seconds * 1e9)

    def _buffer(self, topic: Any, t: float, data: bytes) -> None:
        self.wall_ns += 1_000_000
        self.buffer.add(
            topic,
            BufferedMessage(
                stamp_ns=round(t * 1e9), sent_ns=self.wall_ns, received_ns=self.wall_ns, data=data
            ),
        )


_STANDING = axis_reading()


def test_stop_and_start_are_one_run() -> None:
    machine, start = Machine(), RunStart()
    machine.wind(0.0, 300)
    assert not start.look(machine.buffer)
    machine.wait(20.0)
    machine.wind(0.3, 300, angle=SPEED * 0.3)
    assert not start.look(machine.buffer)


def test_reset_begins_another_run_while_time_goes_on() -> None:
    machine, start = Machine(), RunStart()
    machine.predict()
    machine.wind(0.0, 300)
    assert not start.look(machine.buffer)
    machine.wait(2.0)
    machine.wind(0.3, 40)
    assert start.look(machine.buffer)
    cut_ns, origin = RunStart.cut(machine.buffer)
    machine.buffer.begin_anew(cut_ns, origin)
    assert origin == pytest.approx(0.299)
    stamps = machine.buffer.stamps(topics.JOINT_STATES)
    assert (len(stamps), stamps[0]) == (40, 300_000_000)
    assert len(machine.buffer.messages[topics.JOINT_STATES.name]) == 40
    # Published once before, latched, and true still.
    assert machine.buffer.last(topics.FEM_PREDICTION) is not None
    assert not start.look(machine.buffer)


class Session:
    """What an operator's runs are followed by: encoders and the status of the machine."""

    def __init__(self) -> None:
        self.machine, self.log = Machine(), EventLog(file=None)
        self.status: Status | None = None
        who = SimpleNamespace(
            log=self.log,
            recorder=SimpleNamespace(
                buffer=self.machine.buffer, bags=SimpleNamespace(note=lambda _notes: None)
            ),
            client=SimpleNamespace(status=lambda _name: self.status),
            orchestrator=SimpleNamespace(adopt_parameters=self._adopt),
            machine=None,
        )
        self.conduct = RigConduct(cast(Any, who), {"case": 4})
        self.set_to: dict[str, object] = {"case": 4}

    async def _adopt(self) -> dict[str, dict[str, object]]:
        return {topics.RIG: self.set_to}

    def reports(self, phase: str, t: float, **values: str) -> bool:
        """Report a phase at a time of the machine [s]; return whether the run is over at once."""
        stated = {"phase": phase, "time": f"{t:.3f}", "run_time": f"{t:.3f}"} | values
        self.status = Status(name=topics.RIG, values=stated)
        return self.conduct.look()


async def under_way(session: Session) -> bool:
    """Return whether a run has begun by now."""
    begun = asyncio.ensure_future(session.conduct.begun())
    await asyncio.sleep(0.1)
    begun.cancel()
    return begun.done() and not begun.cancelled()


@pytest.mark.asyncio
async def test_a_status_of_the_machine_before_begins_no_run() -> None:
    session = Session()
    session.machine.wind(0.0, 1500)
    assert not session.reports("winding", 1.499)
    assert await under_way(session)
    # Another machine is built, and the status of the last one comes once more.
    session.machine.wind(0.0, 20)
    assert session.reports("winding", 1.499)
    await session.conduct.made_ready()
    assert not session.reports("winding", 1.499)
    assert not await under_way(session)
    session.machine.wind(0.02, 30, angle=SPEED * 0.02)
    assert not session.reports("winding", 0.049)
    assert await under_way(session)


@pytest.mark.asyncio
async def test_encoders_show_a_run_that_the_machine_has_not_reported() -> None:
    session = Session()
    session.machine.wind(0.0, 1500)
    assert not session.reports("winding", 1.499)
    assert not session.conduct.catch_up()
    session.machine.wind(0.0, 20)
    assert session.conduct.look()
    await session.conduct.made_ready()
    # The encoder trembles where it stands.
    assert not session.conduct.catch_up()
    session.machine.wind(0.02, 200, angle=SPEED * 0.02)
    assert session.conduct.catch_up()
    assert session.conduct.wound == {"case": 4}


@pytest.mark.asyncio
async def test_a_late_status_of_winding_lifts_no_protective_stop() -> None:
    session = Session()
    cause = Cause(by=EndedBy.SUPERVISION, source="cable_fem", text="cable_fem is gone", t=0.4)
    session.machine.wind(0.0, 500)
    # Supervision has stopped the machine before its first status has come.
    session.log.hold(cause)
    session.reports("winding", 0.399)
    session.reports("stopping", 0.499)
    assert session.log.held is cause
    # The operator starts it again.
    session.machine.wind(0.5, 300, angle=SPEED * 0.5)
    session.reports("winding", 0.799)
    assert session.log.held is None


@pytest.mark.asyncio
async def test_a_run_that_was_stopped_is_over_when_its_machine_is_reset() -> None:
    session = Session()
    session.machine.wind(0.0, 700)
    session.reports("winding", 0.699)
    session.reports("stopping", 0.699)
    session.reports("idle", 0.699)
    assert session.conduct.end is None
    session.reports("idle", 0.699, run_time="0.000")
    assert session.conduct.end == pytest.approx(0.699)
    early = session.conduct.early
    assert (early.by, early.text) == (EndedBy.OPERATOR, "stopped by the operator")


def test_machine_that_is_built_anew_begins_at_zero() -> None:
    machine, start = Machine(), RunStart()
    machine.wind(0.0, 300)
    assert not start.look(machine.buffer)
    machine.wait(2.0)
    machine.wind(0.0, 40)
    assert start.look(machine.buffer)
    machine.buffer.begin_anew(*RunStart.cut(machine.buffer))
    assert machine.buffer.origin == 0.0
    assert machine.buffer.last_stamp(topics.JOINT_STATES) == pytest.approx(0.039)
    assert len(machine.buffer.stamps(topics.JOINT_STATES)) == 40


def test_encoder_that_trembles_begins_nothing() -> None:
    machine, start = Machine(), RunStart()
    machine.wind(0.0, 300)
    start.look(machine.buffer)
    machine.wind(0.3, 1, angle=SPEED * 0.299 - 1e-3)
    assert not start.look(machine.buffer)


@pytest.fixture
def client(ros: Any) -> Iterator[AsyncClient]:
    made = AsyncClient(NAMESPACE)
    made.start()
    yield made
    made.close()


def test_subscribers_from_outside_the_graph_are_counted_out(ros: Any, client: AsyncClient) -> None:
    own = {"cable_fem", topics.RECORDER}

    def subscribe(name: str, namespace: str, qos: Any) -> None:
        node = ros.add(Node, name, namespace=namespace)
        topic = f"/{NAMESPACE}/{topics.TENSION.name}"
        node.create_subscription(topics.TENSION.type, topic, lambda message: None, qos)

    subscribe("cable_fem", f"/{NAMESPACE}", topics.TENSION.qos)
    subscribe("dashboard_eyes", f"/{NAMESPACE}", topics.TENSION.qos)
    subscribe("cable_fem", "/elsewhere", topics.TENSION.qos)
    # The publisher offers less than this one asks for: they never match.
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    subscribe("viewer", f"/{NAMESPACE}", latched)
    name = client.node.resolve_topic_name(topics.TENSION.name)

    def known() -> list[str]:
        # An endpoint may be discovered before the name of its node.
        found = client.node.get_subscriptions_info_by_topic(name)
        return sorted(item.node_name for item in found)

    ros.spin_until(lambda: known() == ["cable_fem", "cable_fem", "dashboard_eyes", "viewer"])
    assert outsiders(client, topics.TENSION, own) == 2


def keeper(client: AsyncClient, folder: Path, **parameters: object) -> DashboardProcess:
    set_process_environment(int(os.environ["ROS_DOMAIN_ID"]), folder)
    page = DashboardConfig(parameters=parameters, namespace=NAMESPACE, log_directory=folder)
    return DashboardProcess(page, client, EventLog(file=folder / "events.jsonl"), lambda: math.nan)


@pytest.mark.processes
def test_limits_of_an_operator_outlive_the_page(client: AsyncClient, tmp_path: Path) -> None:
    page = keeper(client, tmp_path, host="127.0.0.1", port=free_port(), error_limit_pct=6.0)
    nodes = LifecycleDriver(client, NAMESPACE, unasked)
    limits = OperatorLimits(error_limit_pct=2.5, lay_tolerance=0.8e-3)
    log = tmp_path / "events.jsonl"

    async def until(reached: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not reached():
                await asyncio.sleep(0.05)

    async def work() -> dict[str, object]:
        await page.start()
        keeping = asyncio.create_task(page.keep())
        try:
            await until(lambda: page.limits == OperatorLimits(error_limit_pct=6.0))
            await nodes.set_parameters("dashboard", vars(limits))
            await until(lambda: page.limits == limits)
            first = page.pid
            os.kill(first, signal.SIGKILL)
            await until(lambda: any(event.what == "restarted" for event in read_events(log)))
            assert page.pid != first
            return await nodes.parameters("dashboard", list(vars(limits)), PATIENCE)
        finally:
            keeping.cancel()
            await page.stop()

    assert asyncio.run(work()) == vars(limits)


async def unasked(node: str) -> str:
    raise AssertionError(f"{node} makes no transition here")


@pytest.mark.processes
def test_refused_page_ends_the_start_with_its_sentence(client: AsyncClient, tmp_path: Path) -> None:
    page = keeper(client, tmp_path, host="0.0.0.0", port=1)

    async def start() -> None:
        try:
            await page.start()
        finally:
            await page.stop()

    with pytest.raises(GraphError, match=r"dashboard ended with exit code 2: host 0\.0\.0\.0 can"):
        asyncio.run(start())
    assert (tmp_path / "dashboard.yaml").stat().st_mode & 0o077 == 0
