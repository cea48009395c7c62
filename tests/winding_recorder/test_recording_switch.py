"""A recorder that is switched on and off while messages come; each time has a bag of its own."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_bags import READING
from std_srvs.srv import SetBool

from winding_core.markers import wound_markers
from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import COMPLETE, YES
from winding_recorder.bags.reading import read_notes
from winding_recorder.live.bag_series import free_folder
from winding_recorder.live.recorder import Recorder
from winding_ros import services, topics
from winding_ros.messages.camera import encode_image
from winding_ros.messages.clouds import encode_cloud
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import encode_joint_state

pytestmark = pytest.mark.processes

RECORDED = (topics.JOINT_STATES, topics.FEM_PREDICTION)


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


def test_recording_again_and_time_that_goes_back_get_own_bags(desk: Desk, tmp_path: Path) -> None:
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


@pytest.mark.parametrize("stamp", [4000.0, -2.0])
def test_a_stamp_of_another_time_begins_no_bag(desk: Desk, tmp_path: Path, stamp: float) -> None:
    desk.record(on=True)
    desk.wind(0, 700)
    desk.joints.publish(encode_joint_state(stamp, READING))
    desk.wind(700, 300)
    desk.record(on=False)
    assert desk.recorder.bags.folders == [tmp_path / "bag"]
    assert counts(tmp_path / "bag")["rig/joint_states"] == 1001


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
