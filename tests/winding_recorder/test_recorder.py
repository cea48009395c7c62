"""The recorder on live topics: nothing lost, bags one after the other, a disk that fills up."""

import json
import shutil
import struct
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from made_bags import READING, Bags
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64

from winding_core.status import Level
from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import COMPLETE, YES, BagError
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.bags.reading import read_notes
from winding_recorder.live.bag_series import BagSeries
from winding_recorder.live.recorder import Recorder, RecorderError
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.environment import child_environment
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.messages.stamps import decode_stamp, with_stamp
from winding_ros.topic import Taken, Topic

pytestmark = pytest.mark.processes

# The graph declares commands at 50 Hz; the machine's control loop runs at 500 Hz.
LOAD = (topics.JOINT_STATES, replace(topics.JOINT_COMMANDS, rate=500.0, depth=1000), topics.IMAGE)
RECORDED = (topics.JOINT_STATES, topics.FEM_PREDICTION)


def record_load(ros: Any, bag: Path, seconds: float) -> tuple[dict[str, float], Recorder]:
    """Return what was published and the recorder of a load."""
    node = ros.plain("load_host")
    recorder = Recorder(node, bag, recorded=LOAD)
    publisher = subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("publish_load.py")), str(seconds)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=child_environment(),
    )
    assert publisher.stdin is not None
    try:
        published = json.loads(publisher.stdout.readline())
        ros.spin_until(
            lambda: all(
                recorder.received[topic.name] + recorder.lost[topic.name] == published[topic.name]
                for topic in LOAD
            )
        )
        publisher.communicate("\n", timeout=30.0)
    finally:
        publisher.kill()
        recorder.close()
    return published, recorder


def at_work(ros: Any, topic: Topic, bag: Path) -> tuple[Any, Recorder, list[Any]]:
    """Return a publisher of a topic, the recorder that hears it alone, and statuses by now."""
    machine, heard = ros.plain("machine"), []
    publisher = topic.advertise(machine)
    topics.DIAGNOSTICS.subscribe(machine, lambda m: heard.extend(decode_diagnostics(m)[1]))
    recorder = Recorder(ros.plain("host"), bag, recorded=[topic])
    ros.spin_until(lambda: publisher.get_subscription_count() == 1)
    return publisher, recorder, heard


@pytest.mark.parametrize(
    "seconds", [5.0, pytest.param(300.0, marks=[pytest.mark.soak, pytest.mark.timeout(900)])]
)
def test_nothing_is_lost_at_full_rate(ros: Any, tmp_path: Path, seconds: float) -> None:
    published, recorder = record_load(ros, tmp_path / "bag", seconds)
    assert recorder.error is None
    assert set(recorder.lost.values()) == {0}
    content = contents(tmp_path / "bag")
    counts = {topic.name.removeprefix("/"): topic.messages for topic in content.topics}
    assert counts == {name: published[name] for name in counts}
    assert check(tmp_path / "bag").findings == []


def test_lost_numbers_are_counted_by_topic(ros: Any, tmp_path: Path) -> None:
    """A reader of one message that is not asked in time loses the others."""
    shallow = replace(topics.JOINT_STATES, depth=1)
    publisher, recorder, _ = at_work(ros, shallow, tmp_path / "bag")
    # What came before the first message that arrived is not a loss.
    publisher.publish(encode_joint_state(0.0, READING))
    ros.spin_until(lambda: bool(recorder.buffer.messages[shallow.name]))
    for sample in range(1, 2000):
        publisher.publish(encode_joint_state(sample * 1e-3, READING))
    ros.spin_until(lambda: recorder.buffer.last_stamp(shallow) >= 1.999)
    recorder.close()
    kept = len(recorder.buffer.messages[shallow.name])
    assert recorder.lost[shallow.name] > 0
    assert kept + recorder.lost[shallow.name] == 2000
    assert any("never reached the recorder" in text for text in check(tmp_path / "bag").findings)


def test_a_full_disk_ends_the_bag_and_not_the_run(ros: Any, small_disk: Path) -> None:
    publisher, recorder, heard = at_work(ros, topics.JOINT_STATES, small_disk / "bag")
    buffered = recorder.buffer.messages["rig/joint_states"]

    def send(count: int) -> None:
        wanted = len(buffered) + count
        for sample in range(len(buffered), wanted):
            publisher.publish(encode_joint_state(sample * 1e-3, READING))
        ros.spin_until(lambda: len(buffered) >= wanted)

    while recorder.error is None and len(buffered) < 20_000:
        send(100)
    assert recorder.error is not None
    # The run goes on: the buffer takes what the disk cannot.
    send(200)
    ros.spin_until(lambda: any(s.level is Level.ERROR for s in heard if s.name == "recorder"))
    recorder.close()
    bag = small_disk / "bag"
    verdict = check(bag)
    assert verdict.findings == []
    assert read_notes(bag)[COMPLETE].startswith("no: No space left on device at ")
    assert 1000 < verdict.messages < len(buffered)


def test_a_recording_that_cannot_begin_gives_the_reason(ros: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecorderError, match="cannot record into"):
        Recorder(ros.plain("host"), tmp_path / "file" / "bag", recorded=[topics.JOINT_STATES])


NUMBER = replace(topics.TENSION, name="rig/humidity", type=Float64, rate=None)


def stamped(seconds: int, nanoseconds: int = 0) -> bytes:
    """Return a joint state with a stamp that no node of this project gives."""
    return with_stamp(encode_joint_state(0.0, READING), struct.pack("<iI", seconds, nanoseconds))


@pytest.mark.parametrize(
    ("topic", "data", "published"),
    [
        (topics.JOINT_STATES, stamped(-3, 5), None),
        (topics.DIAGNOSTICS, stamped(-(2**31), 999_999_999), None),
        (topics.JOINT_STATES, stamped(2**31 - 1, 999_999_999), 2**31 * 10**9 - 1),
        (topics.JOINT_STATES, stamped(2**31 - 1, 2**32 - 1), (2**31 - 1) * 10**9 + 2**32 - 1),
        (topics.DIAGNOSTICS, stamped(0), 0),
        (topics.JOINT_STATES, b"\x00\x01\x00\x00\xff\xff", None),
        (topics.DIAGNOSTICS, b"\x00\x01\x00\x00" + b"\xff" * 50, 3_294_967_295),
        # Its bytes, read as a stamp, are 13 s and 1.07 thousand million nanoseconds before 1970.
        (NUMBER, bytes(serialize_message(Float64(data=-0.7))), None),
        (NUMBER, bytes(serialize_message(Float64(data=6.25))), None),
    ],
    ids=["-3 s", "least", "last", "beyond", "zero", "short", "garbage", "number", "exact number"],
)
def test_no_message_ends_the_recording(
    ros: Any, tmp_path: Path, topic: Topic, data: bytes, published: int | None
) -> None:
    """Every message is stored under its arrival, and the answers to the machine go on."""
    machine = ros.plain("machine")
    joints = topics.JOINT_STATES.advertise(machine)
    other = joints if topic is topics.JOINT_STATES else topic.advertise(machine)
    progress: list[float] = []
    topics.RECORDER_PROGRESS.subscribe(machine, lambda m: progress.append(decode_stamp(m.stamp)))
    recorded = [topics.JOINT_STATES, topics.DIAGNOSTICS, NUMBER]
    before = time.time_ns()
    recorder = Recorder(ros.plain("host"), tmp_path / "bag", recorded=recorded)
    ros.spin_until(lambda: joints.get_subscription_count() == 1 == other.get_subscription_count())
    joints.publish(encode_joint_state(7.25, READING))
    ros.spin_until(lambda: recorder.buffer.last_stamp(topics.JOINT_STATES) == pytest.approx(7.25))
    other.publish(data)
    # The recorder publishes diagnostics of its own, which are stored as well.
    ros.spin_until(lambda: recorder.bags.writer.taken >= 2)
    joints.publish(encode_joint_state(7.5, READING))
    ros.spin_until(lambda: bool(progress) and progress[-1] == 7.5)
    ros.spin_until(lambda: recorder.buffer.last_stamp(topics.JOINT_STATES) == pytest.approx(7.5))
    recorder.close()
    assert recorder.error is None
    assert read_notes(tmp_path / "bag")[COMPLETE] == YES
    stored = Bags.messages(tmp_path / "bag")
    assert all(before <= message.log_time <= time.time_ns() for _, message in stored)
    (found,) = (
        m for name, m in stored if name.endswith(topic.name) and m.data[: len(data)] == data
    )
    if published is None:
        # What has no stamp that a recording can hold was published when it was sent.
        assert abs(found.publish_time - found.log_time) < 60 * 10**9
    else:
        assert found.publish_time == published
    assert list(recorder.buffer.readings(topics.JOINT_STATES))[-1][0] == 7.5


def test_progress_does_not_go_back_when_a_topic_joins(ros: Any, tmp_path: Path) -> None:
    machine = ros.plain("machine")
    joints, pull = (topic.advertise(machine) for topic in (topics.JOINT_STATES, topics.TENSION))
    progress: list[float] = []
    topics.RECORDER_PROGRESS.subscribe(machine, lambda m: progress.append(decode_stamp(m.stamp)))
    recorder = Recorder(
        ros.plain("host"),
        tmp_path / "bag",
        recorded=[topics.JOINT_STATES],
        on_demand=[topics.TENSION],
    )
    ros.spin_until(lambda: joints.get_subscription_count() == 1 == pull.get_subscription_count())
    joints.publish(encode_joint_state(0.08, READING))
    ros.spin_until(lambda: bool(progress))
    for t in (0.06, 0.12):
        pull.publish(encode_tension(t, 1.0))
    joints.publish(encode_joint_state(0.12, READING))
    ros.spin_until(lambda: progress[-1] > 0.1)
    recorder.close()
    assert progress == pytest.approx([0.08, 0.12])


def test_what_has_no_stamp_is_named_once_with_its_reason(ros: Any, tmp_path: Path) -> None:
    publisher, recorder, heard = at_work(ros, topics.TENSION, tmp_path / "bag")
    for _ in range(3):
        publisher.publish(b"\x00\x01\x00\x00\x07")
    named = (
        "rig/tension: 3 messages are not in the report, the first because a stamped message has "
        "at least 12 bytes, got "
    )
    ros.spin_until(lambda: any(named in status.message for status in heard))
    recorder.close()
    (shortfall,) = recorder.shortfalls
    assert shortfall.startswith(named)
    assert contents(tmp_path / "bag").topics[0].messages == 3


def test_what_cannot_be_stored_is_left_out_and_found(tmp_path: Path) -> None:
    """A computer whose clock stands before 1970 gives arrivals that no recording can hold."""
    name = f"/winding/{topics.TENSION.name}"
    series = BagSeries([topics.TENSION], {topics.TENSION.name: name}, BagConfig(), {})
    series.begin(tmp_path / "bag")
    data = encode_tension(1.0, 2.5)
    good = Taken(data, 1, 0, 0, 5 * 10**9, 6 * 10**9)
    series.take(topics.TENSION, 10**9, good)
    for number in (2, 3):
        with pytest.raises(BagError, match="arrived at -1 ns, which must be within 0"):
            series.take(topics.TENSION, 10**9, good._replace(number=number, arrived_at_ns=-1))
        series.refused.add(topics.TENSION.name, "it arrived at -1 ns")
    series.take(topics.TENSION, 2 * 10**9, good._replace(number=4))
    series.end()
    verdict = check(tmp_path / "bag")
    assert verdict.messages == 2
    sentence = "2 messages could not be stored, the first because it arrived at -1 ns"
    assert f"{name}: {sentence}" in verdict.findings


@pytest.mark.parametrize("gone", ["folder", "file"])
def test_removed_bag_is_not_named_and_the_run_goes_on(ros: Any, tmp_path: Path, gone: str) -> None:
    bag = tmp_path / "bag"
    publisher, recorder, heard = at_work(ros, topics.JOINT_STATES, bag)
    publisher.publish(encode_joint_state(0.5, READING))
    ros.spin_until(lambda: recorder.bags.writer.taken == 1)
    if gone == "folder":
        shutil.rmtree(bag)
    else:
        (bag / "bag_0.mcap").unlink()
    ros.spin_until(lambda: any(s.level is Level.ERROR for s in heard if s.name == "recorder"))
    publisher.publish(encode_joint_state(0.75, READING))
    ros.spin_until(lambda: recorder.buffer.last_stamp(topics.JOINT_STATES) == pytest.approx(0.75))
    recorder.close()
    assert str(recorder.error).endswith(f"the bag {bag} was removed")
    assert recorder.bags.present() == ()


def test_what_ends_with_the_recorder_asserts_no_liveliness(ros: Any) -> None:
    """Two participants of one process assert it under each other's locks, and may wait for ever."""
    client = AsyncClient("cell")
    recorder = Recorder(client.node, None, recorded=[topics.JOINT_STATES])
    own = {topics.ORCHESTRATOR, topics.RECORDER}
    found = [
        information
        for name, _ in client.node.get_topic_names_and_types()
        for information in client.node.get_publishers_info_by_topic(name)
        if information.node_name in own
    ]
    recorder.close()
    client.close()
    assert {information.node_name for information in found} == own
    leases = {item.topic_type: item.qos_profile.liveliness_lease_duration for item in found}
    assert all(lease.nanoseconds >= 2**62 for lease in leases.values()), leases
