"""Supervision: stamps, restarts, vitals, second publishers, how the machine is described."""

import asyncio
import itertools
import json
import os
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.machine.watch_clock import WatchClock
from winding_core.run_options import CameraPlacement
from winding_core.run_spec import RunSpec
from winding_core.status import Level
from winding_core.urdf import CarriageLimits, machine_urdf
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.graph import GraphError
from winding_ros.runtime.heartbeat import Heartbeat, heartbeat_topic
from winding_ros.topic import Topic
from winding_supervisor.machines.standing_axes import standing_axes
from winding_supervisor.processes.discovery import RivalWatch
from winding_supervisor.processes.node_process import Backoff
from winding_supervisor.session.run_config import RunConfig
from winding_supervisor.session.run_parts import describe_machine
from winding_supervisor.session.session import Completion
from winding_supervisor.watch.event_log import EventLog, read_events
from winding_supervisor.watch.load_monitor import LoadMonitor
from winding_supervisor.watch.sensor_watch import SensorWatch

SENSORS = ("/clock", "rig/joint_states", "rig/tension", "camera/camera_info")


def looks(stamps_at: object, until: float = 5.0) -> tuple[float, tuple[str, str]] | None:
    """Look each 50 ms of wall time; return when and why something was found."""
    watch = SensorWatch()
    for k in range(int(until / 0.05) + 1):
        now = 0.05 * k
        found = watch.look(now, stamps_at(now), {"tracker/markers": now})  # type: ignore[operator]
        if found is not None:
            return now, found
    return None


def in_step(now: float) -> dict[str, float]:
    return dict.fromkeys(SENSORS, now)


def test_topics_in_step_are_fine_even_when_all_stand() -> None:
    assert looks(in_step) is None
    assert looks(lambda _now: dict.fromkeys(SENSORS, 1.0)) is None


def test_silent_topic_is_named_with_its_last_stamp() -> None:
    when, wrong = looks(lambda now: in_step(now) | {"rig/tension": min(now, 1.0)})
    assert wrong == ("rig/tension", "is silent since 1.000 s of simulated time")
    # A lag of 0.12 s that lasts for 2 s, seen at most one look late.
    assert when == pytest.approx(3.12, abs=0.11)


def test_topic_that_lags_and_catches_up_is_not_silent() -> None:
    assert (
        looks(lambda now: in_step(now) | {"rig/tension": now if now % 0.5 < 0.1 else 0.0}) is None
    )


def test_clock_that_jumps_ahead_is_named() -> None:
    topic, text = looks(lambda now: in_step(now) | {"/clock": 2.0 * now})[1]
    assert topic == "/clock"
    assert text.startswith("is at ")


@pytest.mark.parametrize("late", [topics.IMAGE, topics.PREVIEW, topics.TENSION, topics.FEM_CABLE])
def test_run_is_not_over_before_its_last_messages_have_arrived(late: Topic) -> None:
    end, wall = 2.0, 50.0
    ending, buffer = Completion(end), RunBuffer(topics.TOPICS)
    sent = [topic for topic in topics.TOPICS if topic.rate and topic is not topics.JOINT_COMMANDS]
    for topic in sent:
        buffer.add(topic, message(end if topic is not late else end - 0.5))
    assert not ending.reached(buffer, wall)
    # A machine that is not simulated publishes while it stands, by a clock that may be behind.
    buffer.add(topics.JOINT_STATES, message(end + 0.9))
    buffer.add(late, message(end - 1.0 / (late.rate or 1.0)))
    assert not ending.reached(buffer, wall + 0.9)
    assert ending.reached(buffer, wall + 1.0)
    buffer.add(late, message(end))
    assert Completion(end).reached(buffer, wall)


def message(stamp: float) -> BufferedMessage:
    return BufferedMessage(round(1e9 * stamp), 0, 0, b"")


def test_answer_that_makes_no_progress_is_named() -> None:
    watch = SensorWatch()
    found = [
        watch.look(0.05 * k, in_step(2.0), {"tracker/markers": 1.0, "fem/markers": 2.0})
        for k in range(120)
    ]
    wrong = next(item for item in found if item is not None)
    assert wrong == ("tracker/markers", "has brought nothing new since 1.000 s of simulated time")
    assert found.index(wrong) * 0.05 == pytest.approx(5.0, abs=0.06)


def test_an_answer_is_waited_for_while_its_node_wants_the_processor() -> None:
    watch, working = SensorWatch(), {"tracker/markers", "fem/markers"}
    looks = iter(range(400))

    def first_finding() -> tuple[float, Any]:
        for k in looks:
            # The solver wants none after 10 s; the tracker is given none for 20 s.
            found = watch.look(0.05 * k, in_step(2.0), stamps, working.__contains__)
            if found:
                return 0.05 * k, found
            if k == 200:
                working.remove("fem/markers")
        return 20.0, None

    stamps = {"tracker/markers": 1.0, "fem/markers": 1.2}
    after, found = first_finding()
    assert found == ("fem/markers", "has brought nothing new since 1.200 s of simulated time")
    assert after == pytest.approx(15.0, abs=0.06)


def test_restarts_wait_longer_each_time_and_end_after_three() -> None:
    backoff = Backoff()
    assert [backoff.next_wait(now) for now in (0.0, 5.0, 10.0, 15.0)] == [0.0, 0.5, 1.0, None]


def test_restarts_of_a_minute_ago_do_not_count() -> None:
    backoff = Backoff()
    for now in (0.0, 1.0, 2.0):
        backoff.next_wait(now)
    assert backoff.next_wait(61.5) is not None


def test_events_are_in_the_file_at_their_wall_times(tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    log = EventLog(file=file, clock=lambda: 7.0)
    log.note("detected", "cable_fem", "has stopped", t=1.5)
    log.note("resumed", "winding_rig", "rig/start", t=2.0, wall=9.0)
    assert read_events(file) == log.events
    assert json.loads(file.read_text(encoding="utf-8").splitlines()[0])["t"] == 1.5
    assert [event.wall for event in log.events] == [7.0, 9.0]


def buffered(buffer: RunBuffer, topic: Topic, rows: list[tuple[int, int]]) -> None:
    for stamp, received in rows:
        buffer.add(topic, BufferedMessage(stamp, received, received, b""))


def test_vitals_give_rates_latency_and_lost_frames() -> None:
    buffer = RunBuffer(topics.TOPICS)
    vitals = LoadMonitor(buffer)
    vitals.look(0.0, {})
    frames = [k * 5_000_000 for k in range(200) if k not in (50, 51, 120)]
    buffered(buffer, topics.CAMERA_INFO, [(stamp, stamp) for stamp in frames])
    buffered(buffer, topics.JOINT_STATES, [(stamp, stamp) for stamp in frames])
    # Every fourth frame has its corrected length 8 ms later.
    buffered(buffer, topics.CORRECTED_MARKERS, [(t, t + 8_000_000) for t in frames[::4]])
    level, sentence, values = vitals.look(1.0, {})
    assert (level, sentence) == (Level.WARN, "3 frames are missing")
    assert values["rate camera/camera_info [1/s]"] == "197"
    assert values["frame to corrected length p50 [ms]"] == "8.0"
    assert values["frame to corrected length p99 [ms]"] == "8.0"
    assert vitals.look(2.0, {})[0] is Level.OK


def test_load_is_reported_from_the_second_look_at_a_process_on() -> None:
    vitals = LoadMonitor(RunBuffer(topics.TOPICS))
    assert "cpu test [%]" not in vitals.look(0.0, {"test": os.getpid()})[2]
    assert float(vitals.look(1.0, {"test": os.getpid()})[2]["cpu test [%]"]) >= 0.0
    # Another process in the node's place begins anew.
    assert "cpu test [%]" not in vitals.look(2.0, {"test": os.getppid()})[2]


def test_one_publisher_each_is_nobody_s_rival(ros: Any) -> None:
    watcher, machine = ros.plain("watcher"), ros.plain("winding_rig")
    topics.JOINT_STATES.advertise(machine)
    Heartbeat(machine, topics.RIG)
    watch = RivalWatch(watcher, [topics.RIG])
    ros.spin_until(lambda: watcher.count_publishers(heartbeat_topic(topics.RIG)) == 1)
    assert watch.look(0.0) is None


@pytest.mark.parametrize("name", [topics.RIG, topics.ORCHESTRATOR])
def test_a_foreign_sign_of_life_is_named(ros: Any, name: str) -> None:
    watcher, own, foreign = ros.plain("watcher"), ros.plain(name), ros.plain("foreign")
    signs = [Heartbeat(node, name) for node in (own, foreign)]
    watch = RivalWatch(watcher, [topics.RIG])
    ros.spin_until(lambda: watch.look(0.0))
    both = ", ".join(sorted([f"/{name}", "/foreign"]))
    assert watch.look(0.0) == (f"{name}/heartbeat", f"has 2 publishers: {both}")
    del signs


def test_a_second_driver_is_named(ros: Any) -> None:
    watcher = ros.plain("watcher")
    publishers = [
        topics.JOINT_STATES.advertise(ros.plain(name)) for name in ("winding_rig", "foreign")
    ]
    watch = RivalWatch(watcher, [])
    ros.spin_until(lambda: watch.look(0.0))
    assert watch.look(0.0) == ("rig/joint_states", "has 2 publishers: /foreign, /winding_rig")
    del publishers


def test_the_successor_of_a_killed_node_is_no_rival_while_it_is_forgotten(ros: Any) -> None:
    watcher = ros.plain("watcher")
    nodes = [ros.plain("cable_fem") for _ in range(2)]
    publishers = [topics.FEM_MARKERS.advertise(node) for node in nodes]
    watch = RivalWatch(watcher, [])
    ros.spin_until(lambda: watcher.count_publishers(topics.FEM_MARKERS.name) == 2)
    assert watch.look(0.0) is None
    assert watch.look(9.0) is None
    contested = watch.look(11.0)
    assert "has 2 publishers" in contested[1]
    del publishers


def config(tmp_path: Path) -> RunConfig:
    file = tmp_path / "own.yaml"
    limits = {"carriage_travel": [-0.2, 0.7], "carriage_speed_limit": 0.05}
    content = {"/winding/winding_rig": {"ros__parameters": limits}}
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    asked = {"case": 8, "camera_position_mm": "500,0,100", "parameters": file}
    return RunConfig(spec=RunSpec.from_cell(None, asked), directory=tmp_path)


def test_a_late_subscriber_gets_the_machine_of_the_run(ros: Any, tmp_path: Path) -> None:
    reported: list[str] = []
    describe_machine(
        config(tmp_path), {"cylinder_offset": 37.2}, ros.plain("orchestrator"), reported.append
    )
    heard: list[Any] = []
    topics.ROBOT_DESCRIPTION.subscribe(ros.plain("late"), heard.append)
    ros.spin_until(lambda: heard)
    assert heard[0].data == machine_urdf(
        Condition(case=8).resolved(),
        MachineAxes(cylinder_offset=37.2),
        CameraPlacement(camera_position=[0.5, 0.0, 0.1]),
        CarriageLimits(low=-0.2, high=0.7, speed=0.05),
    )
    assert reported == []


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ([["drum", "slide"]], "50 messages/s arrive on rig/joint_states with joints drum, slide;"),
        ([["drum"], ["slide"]], "joints drum, slide, one in each; configured are cylinder_joint"),
        (
            [["cylinder_joint"], ["carriage_joint"]],
            "one in each; each message needs both cylinder_joint and carriage_joint",
        ),
    ],
)
def test_joint_states_of_no_machine_are_named(names: list[list[str]], words: str) -> None:
    buffer = RunBuffer([topics.JOINT_STATES])
    for k in range(51):
        heard = names[k % len(names)]
        state = JointState(name=heard, position=[1.0] * len(heard))
        arrived, data = 20_000_000 * k, serialize_message(state)
        buffer.add(topics.JOINT_STATES, BufferedMessage(arrived, arrived, arrived, data))
    # Every look at the clock is a minute after the one before.
    looks = itertools.count(0.0, 60.0)
    node: Any = None
    with pytest.raises(GraphError, match=re.escape(words)):
        asyncio.run(standing_axes(node, buffer, MachineAxes(), lambda: next(looks)))


def test_a_watch_that_was_held_takes_no_topic_for_silent() -> None:
    clock, watch = WatchClock(), SensorWatch()
    for now in (10.0, 10.05, 13.4, 13.45):
        stamps = dict.fromkeys(("clock", "rig/joint_states"), now)
        stamps["rig/tension"] = 10.0 if now < 13.42 else now
        assert watch.look(clock.look(now), stamps, {}) is None
    assert clock.time == pytest.approx(0.3)
