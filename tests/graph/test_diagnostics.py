"""The diagnostics of a run, as its bag keeps them: nodes, rates, latencies."""

import re
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import pytest
from rclpy.duration import Duration

from winding_recorder.bags.reading import decoded, messages_of, opened
from winding_ros import topics
from winding_ros.graph import GRAPH
from winding_ros.messages.rig import encode_tension

pytestmark = pytest.mark.processes

NODES = tuple(spec.name for spec in GRAPH)
MAX_LEAD = 0.25  # Simulated time leads the slowest reader by at most so much


@dataclass(frozen=True, kw_only=True)
class Reported:
    """One status of one message, at its stamp [s]."""

    t: float
    level: int
    hardware: str
    values: dict[str, str]


@pytest.fixture(scope="module")
def reported(recorded_run: Any) -> dict[str, list[Reported]]:
    found = defaultdict(list)
    with opened(recorded_run.bag) as reader:
        links = [link for link in reader.connections if link.topic == topics.DIAGNOSTICS.name]
        for link, _, data in messages_of(reader, links):
            message = decoded(reader, link, data)
            t = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            for status in message.status:
                found[status.name].append(
                    Reported(
                        t=t,
                        level=int(status.level),
                        hardware=status.hardware_id,
                        values={item.key: item.value for item in status.values},
                    )
                )
    return dict(found)


def numbers(entries: list[Reported], key: str) -> list[float]:
    return [float(entry.values[key]) for entry in entries if key in entry.values]


def test_every_node_reports_its_work_and_of_its_topics(reported: dict[str, list[Reported]]) -> None:
    expected = {*NODES, *(f"{name}: topics" for name in NODES)}
    assert expected | {"recorder", "orchestrator: vitals"} <= set(reported)


def test_names_and_hardware_are_those_of_rep_107(reported: dict[str, list[Reported]]) -> None:
    assert reported
    for name, entries in reported.items():
        assert re.fullmatch(r"[a-z_]+(: [a-z ]+)?", name)
        assert {entry.hardware for entry in entries} == {"/winding"}
        assert {entry.level for entry in entries} <= {0, 1, 2}


def test_a_run_without_faults_has_no_error(reported: dict[str, list[Reported]]) -> None:
    assert not [name for name, entries in reported.items() for entry in entries if entry.level > 1]


def test_stamps_are_simulated_time(reported: dict[str, list[Reported]], recorded_run: Any) -> None:
    for name, entries in reported.items():
        assert all(0.0 <= entry.t <= recorded_run.duration + 1e-6 for entry in entries), name


def test_rates_are_in_the_ratio_of_the_contract(reported: dict[str, list[Reported]]) -> None:
    vitals = reported["orchestrator: vitals"]
    measured = {
        topic.name: sum(numbers(vitals, f"rate {topic.name} [1/s]"))
        for topic in (topics.JOINT_STATES, topics.TENSION, topics.CAMERA_INFO, topics.FEM_MARKERS)
    }
    assert min(measured.values()) > 0.0
    for topic in (topics.TENSION, topics.CAMERA_INFO, topics.FEM_MARKERS):
        assert topic.rate is not None
        # A look falls between two messages; simulated time leads a reader by a quarter of a
        # second, which is a good part of the spans of this short run.
        ratio = measured[topics.JOINT_STATES.name] / measured[topic.name]
        assert ratio == pytest.approx(1000.0 / topic.rate, rel=0.5), topic.name


def test_latency_is_reported_with_its_tail(reported: dict[str, list[Reported]]) -> None:
    vitals = reported["orchestrator: vitals"]
    median = numbers(vitals, "frame to corrected length p50 [ms]")
    tail = numbers(vitals, "frame to corrected length p99 [ms]")
    assert median
    assert all(0.0 < p50 <= p99 for p50, p99 in zip(median, tail, strict=True))
    assert max(tail) < 60_000.0


def test_drops_are_counted_and_there_are_none(reported: dict[str, list[Reported]]) -> None:
    assert set(numbers(reported["orchestrator: vitals"], "lost frames")) == {0.0}
    assert set(numbers(reported["recorder"], "lost")) == {0.0}


@pytest.mark.parametrize("spec", GRAPH, ids=lambda spec: spec.name)
def test_each_reader_reports_its_queues(reported: dict[str, list[Reported]], spec: Any) -> None:
    entries = reported[f"{spec.name}: topics"]
    # The axes are not commanded here, and no lay is controlled.
    absent = (topics.COMMANDER, topics.LAY_CONTROL)
    heard = [topic for topic in spec.subscribes if topic.publisher not in absent]
    assert {topic.name for topic in heard} <= {
        key.removeprefix("queue ") for entry in entries for key in entry.values
    }
    for topic in heard:
        queue = numbers(entries, f"queue {topic.name}")
        # A node wakes up for one message; a history that was ever full may have lost some.
        assert 1.0 <= max(queue) < topic.depth, topic.name


def test_recorder_and_machine_report_what_waits(reported: dict[str, list[Reported]]) -> None:
    assert min(numbers(reported["recorder"], "waiting")) >= 0.0
    paced = [spec.answer.name for spec in GRAPH if spec.answer is not None]
    assert paced
    for name in (*paced, topics.RECORDER_PROGRESS.name):
        lead = numbers(reported["winding_rig"], f"lead over {name} [s]")
        assert lead
        # One control step may be under way when time is held.
        assert 0.0 <= max(lead) <= MAX_LEAD + 0.01, name


@pytest.mark.parametrize("process", [*NODES, "orchestrator"])
def test_load_and_memory_are_reported(reported: dict[str, list[Reported]], process: str) -> None:
    vitals = reported["orchestrator: vitals"]
    assert max(numbers(vitals, f"cpu {process} [%]")) > 0.0
    assert min(numbers(vitals, f"memory {process} [MiB]")) > 30.0


def test_queue_is_what_waited_when_the_node_woke_up(ros: Any) -> None:
    publisher = topics.TENSION.advertise(ros.plain("load_cell"))
    found: list[int] = []
    # What arrives while the others are served is served too, and was no queue.
    topics.TENSION.subscribe(
        ros.plain("reader"),
        lambda _: publisher.publish(encode_tension(1.0, 1.0)) if not found else None,
        found=found.append,
    )
    ros.spin_until(lambda: publisher.get_subscription_count() == 1)
    for sample in range(30):
        publisher.publish(encode_tension(0.01 * sample, 1.0))
    assert publisher.wait_for_all_acked(Duration(seconds=60))
    ros.spin_until(lambda: found)
    assert found[0] == 30
