"""Frames that are tracked in the process of the camera or of the rig that takes them."""

import json
from pathlib import Path
from typing import Any

import pytest
from composed_graph import composed_run
from std_srvs.srv import Trigger

from winding_core.cable.cases import published_markers
from winding_core.machine.camera_source import CameraSource, CameraSourceError
from winding_recorder.bags.contents import contents
from winding_ros import topics
from winding_ros.graph import CAMERA_TOPICS, GRAPH, RIG, SIMULATED_CAMERA, TRACKER, composed


@pytest.mark.processes
@pytest.mark.parametrize("rate", [200, pytest.param(1000, marks=pytest.mark.campaign)])
def test_every_simulated_frame_is_tracked(rate: int, tmp_path: Path, command: Any) -> None:
    command(
        *("run", "--case", 4, "--duration-s", 5, "--speed", 0, "--compose", "camera"),
        *("--frame-rate", rate, "--output", "run", "--bag", "bag"),
        cwd=tmp_path,
        code=0,
    )
    recorded = {topic.name: topic.messages for topic in contents(tmp_path / "bag").topics}
    assert recorded["/winding/tracker/markers"] == 5 * rate + 1
    assert recorded["/winding/camera/camera_info"] == 5 * rate + 1
    # One in 40 ms, for recorder and operator.
    for shown in ("/winding/camera/image_raw", "/winding/camera/image_raw/compressed"):
        assert recorded[shown] == 5 * 25 + 1
    numbers = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    first = numbers["markers"][0]["s_tracked_m"]
    measured = published_markers(4)[0].experiment
    # The tracker's own bound for a marker that has just been seen.
    assert first == pytest.approx(measured.s, rel=1e-3)


def test_a_composed_graph_has_one_publisher_of_each_camera_topic() -> None:
    graph = composed(GRAPH, SIMULATED_CAMERA)
    for topic in CAMERA_TOPICS:
        assert [spec.name for spec in graph if topic in spec.publishes] == [TRACKER.name]
        assert topic in RIG.publishes
    tracker = next(spec for spec in graph if spec.name == TRACKER.name)
    assert tracker.command == ("-m", "marker_tracker_node", "--camera", SIMULATED_CAMERA)


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        ("camera", "a camera is MODULE:FUNCTION"),
        (":open", "a camera is MODULE:FUNCTION"),
        ("no_such_place.py:open", "no camera at no_such_place.py"),
        ("no_such_package.camera:open", "there is no module no_such_package.camera"),
        ("json:no_such_function", "json has no function no_such_function"),
        (".relative:open", ".relative cannot be imported: ImportError"),
    ],
)
def test_what_is_no_camera_is_refused_in_one_sentence(source: str, sentence: str) -> None:
    with pytest.raises(CameraSourceError, match=sentence):
        CameraSource.parsed(source).load()


@pytest.mark.parametrize("place", ["broken.py", "broken.camera"])
def test_a_camera_that_cannot_be_imported_is_refused_in_one_sentence(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "broken"
    package.mkdir()
    for file in (tmp_path / "broken.py", package / "__init__.py"):
        file.write_text("import a_library_that_is_missing\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(
        CameraSourceError,
        match="cannot be imported: ModuleNotFoundError: No module named 'a_library_that_is_missing",
    ):
        CameraSource.parsed(f"{place}:open_camera").load()


@pytest.mark.slow
def test_frames_handed_over_in_process_are_all_tracked(ros: Any, compose: Any) -> None:
    recorded = [topic for topic in topics.TOPICS if topic.recorded and topic is not topics.IMAGE]
    condition, images = {"case": 4, "duration": 1.0}, []
    with composed_run(compose, ros, condition, recorded) as (listener, recorder):
        topics.IMAGE.subscribe(listener, images.append, raw=True)
        assert ros.call(listener, Trigger, "rig/start", Trigger.Request()).success
        ros.spin_until(lambda: recorder.buffer.last_stamp(topics.TRACKED_MARKERS) >= 1.0)
    stamps = [message.stamp_ns for message in recorder.buffer.messages["tracker/markers"]]
    assert stamps == [frame * 5_000_000 for frame in range(201)]
    assert images == []
