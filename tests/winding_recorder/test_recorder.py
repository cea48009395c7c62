"""The recorder on live topics: nothing lost, little processor time, and a disk that fills up."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from made_bags import READING

from winding_core.status import Level
from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import COMPLETE
from winding_recorder.bags.reading import read_notes
from winding_recorder.live.recorder import Recorder, RecorderError
from winding_ros import topics
from winding_ros.environment import child_environment
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import decode_joint_state, encode_joint_state

pytestmark = pytest.mark.processes

# The graph declares commands at 50 Hz; the machine's control loop runs at 500 Hz.
LOAD = (
    topics.JOINT_STATES,
    replace(topics.JOINT_COMMANDS, rate=500.0, depth=1000),
    topics.IMAGE,
)


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
    assert publisher.stdout is not None
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
    node, publisher_node = ros.plain("host"), ros.plain("machine")
    publisher = topics.JOINT_STATES.advertise(publisher_node)
    recorder = Recorder(node, tmp_path / "bag", recorded=[shallow])
    ros.spin_until(lambda: publisher.get_subscription_count() == 1)
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
    node, machine = ros.plain("host"), ros.plain("machine")
    publisher = topics.JOINT_STATES.advertise(machine)
    heard: list[Any] = []
    topics.DIAGNOSTICS.subscribe(machine, lambda m: heard.extend(decode_diagnostics(m)[1]))
    recorder = Recorder(node, small_disk / "bag", recorded=[topics.JOINT_STATES])
    ros.spin_until(lambda: publisher.get_subscription_count() == 1)
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


def test_a_recording_that_cannot_begin_says_why(ros: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecorderError, match="cannot record into"):
        Recorder(ros.plain("host"), tmp_path / "file" / "bag", recorded=[topics.JOINT_STATES])


def test_bytes_without_a_stamp_are_counted_and_the_recording_goes_on(
    ros: Any, tmp_path: Path
) -> None:
    machine = ros.plain("machine")
    publisher = topics.JOINT_STATES.advertise(machine)
    heard: list[Any] = []
    topics.DIAGNOSTICS.subscribe(machine, lambda m: heard.extend(decode_diagnostics(m)[1]))
    recorder = Recorder(ros.plain("host"), tmp_path / "bag", recorded=[topics.JOINT_STATES])
    ros.spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(b"\x00\x01\x00\x00")
    publisher.publish(b"\x00\x01\x00\x00" + b"\xff" * 40)
    publisher.publish(encode_joint_state(1.0, READING))
    ros.spin_until(lambda: recorder.buffer.last_stamp(topics.JOINT_STATES) == 1.0)
    ros.spin_until(lambda: any("1 messages had no stamp" in s.message for s in heard))
    recorder.close()
    # Bytes that are no joint state are kept in the bag and left out of what is read back.
    assert contents(tmp_path / "bag").topics[0].messages == 2
    assert list(recorder.buffer.readings(topics.JOINT_STATES, decode_joint_state)) == [
        (1.0, READING)
    ]
    assert recorder.buffer.newest(topics.JOINT_STATES, decode_joint_state) == (1.0, READING)
