"""The recorder on live topics: nothing lost, bags one after the other, a disk that fills up."""

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_bags import READING
from std_srvs.srv import SetBool

from winding_core.markers import wound_markers
from winding_core.status import Level
from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import COMPLETE, YES
from winding_recorder.bags.reading import read_notes
from winding_recorder.live.bag_series import free_folder
from winding_recorder.live.recorder import Recorder, RecorderError
from winding_ros import services, topics
from winding_ros.environment import child_environment
from winding_ros.messages.camera import encode_image
from winding_ros.messages.clouds import encode_cloud
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import decode_joint_state, encode_joint_state

pytestmark = pytest.mark.processes

# The graph declares commands at 50 Hz; the machine's control loop runs at 500 Hz.
LOAD = (
    topics.JOINT_STATES,
    replace(topics.JOINT_COMMANDS, rate=500.0, depth=1000),
    topics.IMAGE,
)
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


def test_a_recording_that_cannot_begin_gives_the_reason(ros: Any, tmp_path: Path) -> None:
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


class Desk:
    """A machine that publishes, a recorder, and a client that turns it on and off."""

    def __init__(self, ros: Any, further: Path) -> None:
        self.ros = ros
        self.machine = ros.plain("machine")
        self.joints = topics.JOINT_STATES.advertise(self.machine)
        self.images = topics.IMAGE.advertise(self.machine)
        self.prediction = topics.FEM_PREDICTION.advertise(self.machine)
        self.statuses: dict[str, Any] = {}
        topics.DIAGNOSTICS.subscribe(self.machine, self._note)
        self.recorder = Recorder(
            ros.plain("host"), None, recorded=RECORDED, further=further, on_demand=[topics.IMAGE]
        )
        ros.spin_until(lambda: self.joints.get_subscription_count() == 1)

    def _note(self, message: Any) -> None:
        self.statuses |= {status.name: status for status in decode_diagnostics(message)[1]}

    def predict(self, t: float = 0.0) -> None:
        markers = wound_markers(
            ids=[1], theta=np.array([6.0]), z=[0.01], radius=0.017, cylinder_angle=0.0
        )
        self.prediction.publish(encode_cloud(t, markers))
        self.ros.spin_until(lambda: self.recorder.buffer.last_stamp(topics.FEM_PREDICTION) == t)

    def wind(self, first: int, count: int) -> None:
        for sample in range(first, first + count):
            self.joints.publish(encode_joint_state(sample * 1e-3, READING))
        end = (first + count - 1) * 1e-3
        self.ros.spin_until(
            lambda: self.recorder.buffer.last_stamp(topics.JOINT_STATES) == pytest.approx(end)
        )

    def record(self, on: bool) -> Any:
        return self.ros.call(self.machine, SetBool, services.RECORD.name, SetBool.Request(data=on))


@pytest.fixture
def desk(ros: Any, tmp_path: Path) -> Iterator[Desk]:
    made = Desk(ros, tmp_path / "bag")
    yield made
    made.recorder.close()


def counts(bag: Path) -> dict[str, int]:
    return {topic.name.removeprefix("/"): topic.messages for topic in contents(bag).topics}


def test_bag_holds_what_came_between_on_and_off(desk: Desk, tmp_path: Path) -> None:
    desk.predict()
    desk.wind(0, 300)
    began = desk.record(on=True)
    assert (began.success, began.message) == (True, f"recording into {tmp_path / 'bag'}")
    desk.wind(300, 200)
    ended = desk.record(on=False)
    assert ended.success
    assert ended.message.startswith(f"{tmp_path / 'bag'}: 201 messages, ")
    desk.wind(500, 100)
    assert check(tmp_path / "bag").findings == []
    assert read_notes(tmp_path / "bag")[COMPLETE] == YES
    # The prediction was published before, once, and holds all the same.
    assert counts(tmp_path / "bag") == {
        "rig/joint_states": 200,
        "fem/prediction": 1,
        "camera/image_raw": 0,
    }


def test_pictures_are_taken_only_while_a_bag_is_recorded(desk: Desk, tmp_path: Path) -> None:
    assert desk.images.get_subscription_count() == 0
    desk.record(on=True)
    desk.ros.spin_until(lambda: desk.images.get_subscription_count() == 1)
    desk.images.publish(encode_image(0.005, np.zeros((4, 6, 3), np.uint8)))
    desk.wind(0, 10)
    desk.ros.spin_until(lambda: desk.recorder.received[topics.IMAGE.name] == 1)
    desk.record(on=False)
    desk.ros.spin_until(lambda: desk.images.get_subscription_count() == 0)
    assert counts(tmp_path / "bag")["camera/image_raw"] == 1


def test_asking_twice_changes_nothing(desk: Desk, tmp_path: Path) -> None:
    assert desk.record(on=False).message == "nothing is being recorded"
    first, second = desk.record(on=True), desk.record(on=True)
    assert (second.success, second.message) == (True, first.message)
    assert desk.recorder.bags.folders == [tmp_path / "bag"]


def test_recording_again_and_time_that_goes_back_get_bags_of_their_own(
    desk: Desk, tmp_path: Path
) -> None:
    desk.record(on=True)
    desk.wind(0, 1000)
    desk.record(on=False)
    desk.record(on=True)
    desk.wind(1000, 1000)
    # A machine that is built anew begins at zero; its prediction comes before it moves.
    desk.predict()
    desk.wind(0, 50)
    desk.ros.spin_until(lambda: len(desk.recorder.bags.folders) == 3)
    desk.recorder.close()
    assert [counts(tmp_path / name)["rig/joint_states"] for name in ("bag", "bag-2", "bag-3")] == [
        1000, 1000, 50,
    ]  # fmt: skip
    assert counts(tmp_path / "bag-3")["fem/prediction"] == 1
    for name in ("bag", "bag-2", "bag-3"):
        assert check(tmp_path / name).findings == []


def test_notes_of_a_new_run_are_not_those_of_the_last_one(desk: Desk, tmp_path: Path) -> None:
    desk.recorder.bags.note({"case": "4"})
    desk.record(on=True)
    desk.wind(0, 1000)
    desk.recorder.bags.note({"case": "5"})
    desk.wind(0, 50)
    desk.ros.spin_until(lambda: len(desk.recorder.bags.folders) == 2)
    desk.recorder.close()
    assert [read_notes(tmp_path / name)["case"] for name in ("bag", "bag-2")] == ["4", "5"]


def test_recorder_reports_what_it_records(desk: Desk) -> None:
    desk.ros.spin_until(lambda: desk.statuses.get("recorder") is not None)
    assert "bag" not in desk.statuses["recorder"].values
    desk.record(on=True)
    desk.wind(0, 100)

    def reported() -> bool:
        values = desk.statuses["recorder"].values
        return values.get("bag") == "bag" and values["messages"] == "100"

    desk.ros.spin_until(reported)
    assert int(desk.statuses["recorder"].values["bytes"]) > 0


def test_bag_that_cannot_begin_is_refused_with_its_cause(ros: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    desk = Desk(ros, tmp_path / "file" / "bag")
    answer = desk.record(on=True)
    assert not answer.success
    assert answer.message.startswith("cannot record into")
    desk.recorder.close()
    assert desk.recorder.error is None


def test_first_free_folder_is_taken(tmp_path: Path) -> None:
    assert free_folder(tmp_path / "bag") == tmp_path / "bag"
    for name in ("bag", "bag-2"):
        (tmp_path / name).mkdir()
    assert free_folder(tmp_path / "bag") == tmp_path / "bag-3"
