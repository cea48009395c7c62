"""Recorded runs: rendered sequences, videos, bags; what `winding render` and `track` do."""

import csv
import json

import cv2
import numpy as np
import pytest
from typer import Typer
from typer.testing import CliRunner

from marker_tracker_node.camera.frame_sources import FrameSource, read_bag
from marker_tracker_node.camera.recordings import Motion, RecordingError, read_motion
from winding_cli.commands.render import render
from winding_cli.commands.track import track


def command(function):
    app = Typer()
    app.command()(function)
    return lambda *words: CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """A rendered run that covers the arrival of P1."""
    folder = tmp_path_factory.mktemp("run")
    result = command(render)(folder, "--case", 4, "--fps", 25, "--duration-s", 5)
    assert result.exit_code == 0, result.output
    return folder


def table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_render_writes_frames_motion_truth_and_camera(sequence):
    assert len(list(sequence.glob("frame_*.png"))) == 125
    assert len(table(sequence / "motion.csv")) == 125
    truth = table(sequence / "truth.csv")
    assert len(truth) == 125 * 5
    assert float(truth[1]["theta"]) == pytest.approx(6.28)
    assert (sequence / "camera.yaml").exists()


def check(out):
    last = {int(row["id"]): row for row in table(out)[-5:]}
    # 0.2 % of S_1 of case 4.
    assert float(last[1]["s"]) == pytest.approx(0.10685, rel=0.002)
    assert int(last[2]["flags"]) & 16


def test_the_lay_is_written_beside_the_markers(sequence, tmp_path):
    lay = tmp_path / "lay.csv"
    where = ("--camera", sequence / "camera.yaml", "--motion", sequence / "motion.csv")
    result = command(track)(
        sequence, "--output", tmp_path / "out.csv", "--lay", lay, "--case", 4, "--fps", 25, *where
    )
    assert result.exit_code == 0, result.output
    places = [row for row in table(lay) if float(row["theta_rad"]) > 0.1]
    # 7.8 rad are wound after 5 s, of which the last 0.7 rad have not passed all rows.
    assert len(places) >= 7.0 / (2.0 * np.pi) * 72
    assert float(places[0]["z_mm"]) == pytest.approx(0.0, abs=0.5)
    assert "free length" in result.output


def test_what_is_printed_is_written_as_json(sequence, tmp_path):
    # The film shows a cylinder of 30 mm; a wrong number is named in the file, too.
    found = tmp_path / "found.json"
    result = command(track)(
        *(sequence, "--camera", sequence / "camera.yaml", "--motion", sequence / "motion.csv"),
        *("--output", tmp_path / "out.csv", "--case", 4, "--cylinder-diameter-mm", 31.5),
        *("--json", found),
    )
    assert result.exit_code == 0, result.output
    record = json.loads(found.read_text(encoding="utf-8"))
    assert not record["healthy"]
    assert record["frames"] == 125
    assert [item["number"] for item in record["contradictions"]] == ["cylinder_diameter"]
    assert record["contradictions"][0]["sentence"] in result.output.replace("\n", "")
    assert record["markers"][1]["mean"]["sigma_z_m"] > 0.0
    assert record["markers"][4]["mean"] is None


OWN = (
    *("--cylinder-diameter-mm", 30, "--cable-diameter-mm", 4),
    *("--tension-n", 3.924, "--marker-spacing-mm", 100, "--camera-position-mm", "420,1,50"),
)


def test_a_cable_of_ones_own_is_tracked(sequence, tmp_path):
    # The same film as case 4, given in its own numbers and with the camera 2.5 mm off.
    out = tmp_path / "own.csv"
    result = command(track)(
        *(sequence, "--camera", sequence / "camera.yaml", "--motion", sequence / "motion.csv"),
        *("--output", out, *OWN),
    )
    assert result.exit_code == 0, result.output
    last = {int(row["id"]): row for row in table(out)[-5:]}
    # Case 4 of Table 5; the camera is 1 % nearer, and the run is too short to refine.
    assert float(last[1]["s"]) == pytest.approx(0.10685, rel=0.01)


def test_an_own_cable_needs_all_of_its_numbers(sequence, tmp_path):
    out = tmp_path / "own.csv"
    result = command(track)(sequence, "--output", out, "--cable-diameter-mm", 4)
    assert result.exit_code == 2
    result = command(track)(sequence, "--output", out, "--camera-position-mm", "1,2")
    assert result.exit_code == 2


def test_track_measures_a_folder(sequence, tmp_path):
    out = tmp_path / "markers.csv"
    result = command(track)(
        sequence, "--camera", sequence / "camera.yaml", "--motion", sequence / "motion.csv",
        "--output", out, "--case", 4,
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "2 markers known" in result.output
    check(out)


def test_track_measures_a_video(sequence, tmp_path):
    path, out = tmp_path / "run.avi", tmp_path / "markers.csv"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25.0, (640, 96))
    for _, frame in FrameSource(sequence):
        video.write(frame)
    video.release()
    result = command(track)(
        path, "--camera", sequence / "camera.yaml", "--motion", sequence / "motion.csv",
        "--output", out, "--case", 4, "--no-refine",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    check(out)


def test_track_measures_a_bag_of_any_topics(sequence, tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = store.types

    def header(t):
        stamp = kinds["builtin_interfaces/msg/Time"](sec=int(t), nanosec=round((t % 1) * 1e9))
        return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="any")

    from marker_tracker_node.camera.calibration import read_camera

    camera = read_camera(sequence / "camera.yaml")
    roi = kinds["sensor_msgs/msg/RegionOfInterest"](
        x_offset=camera.roi[0], y_offset=camera.roi[1], width=camera.roi[2], height=camera.roi[3],
        do_rectify=False,
    )  # fmt: skip
    path = tmp_path / "bag"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        links = {
            name: writer.add_connection(f"/elsewhere/{name}", name, typestore=store)
            for name in (
                "sensor_msgs/msg/Image",
                "sensor_msgs/msg/CameraInfo",
                "sensor_msgs/msg/JointState",
            )
        }

        def put(kind, t, /, **fields):
            message = kinds[kind](header=header(t), **fields)
            writer.write(links[kind], round(t * 1e9), store.serialize_cdr(message, kind))

        motion = read_motion(sequence / "motion.csv")
        for k, (t, frame) in enumerate(FrameSource(sequence)):
            put(
                "sensor_msgs/msg/JointState", t, name=["carriage_joint", "cylinder_joint"],
                position=np.array([motion.guide_z[k], motion.cylinder_angle[k]]),
                velocity=np.zeros(2), effort=np.zeros(0),
            )  # fmt: skip
            put(
                "sensor_msgs/msg/CameraInfo", t, height=1080, width=1920,
                distortion_model="plumb_bob", d=camera.d, k=camera.k.ravel(),
                r=np.eye(3).ravel(), p=np.zeros(12), binning_x=3, binning_y=3, roi=roi,
            )  # fmt: skip
            put(
                "sensor_msgs/msg/Image", t, height=96, width=640, encoding="rgb8",
                is_bigendian=0, step=1920,
                data=np.ascontiguousarray(frame[..., ::-1]).ravel(),
            )  # fmt: skip
    out = tmp_path / "markers.csv"
    result = command(track)(path, "--output", out, "--case", 4)
    assert result.exit_code == 0, result.output
    check(out)
    assert read_bag(path).camera.binning == 3
    first = next(iter(FrameSource(path)))[1]
    assert (first == next(iter(FrameSource(sequence)))[1]).all()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["nowhere", "--output", "x.csv"], "does not exist"),
        (["{run}", "--output", "x.csv"], "there is no camera"),
        (["{run}", "--output", "x.csv", "--camera", "{run}/camera.yaml"], "there is no motion"),
        (["{run}", "--output", "x.csv", "--camera", "{run}/motion.csv"], "camera file"),
        (
            ["{run}", "--output", "x.csv", "--case", "13", "--camera", "{run}/camera.yaml"],
            "case must be",
        ),
        (
            ["{run}", "--output", "x.csv", "--camera", "{run}/camera.yaml", "--motion",
             "{run}/truth.csv"],
            "must have the columns",
        ),
    ],
)  # fmt: skip
def test_track_refuses_with_one_sentence(sequence, words, reason):
    result = command(track)(*(word.format(run=sequence) for word in words))
    assert result.exit_code == 2
    assert reason in result.output
    assert "Traceback" not in result.output


def test_recordings_that_cannot_be_read_are_refused(tmp_path):
    with pytest.raises(RecordingError, match="frame rate"):
        next(iter(FrameSource(tmp_path)))
    with pytest.raises(RecordingError, match="no picture"):
        next(iter(FrameSource(tmp_path, fps=10.0)))
    (tmp_path / "a.png").write_text("no picture at all")
    with pytest.raises(RecordingError, match="not a picture"):
        next(iter(FrameSource(tmp_path, fps=10.0)))
    with pytest.raises(RecordingError, match=r"not a video|holds no frame"):
        next(iter(FrameSource(tmp_path / "a.png")))
    with pytest.raises(RecordingError, match="cannot read"):
        read_bag(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match="ascend"):
        Motion(t=np.array([1.0, 0.0]), cylinder_angle=np.zeros(2), guide_z=np.zeros(2))


def test_motion_outside_its_readings_is_unknown():
    motion = Motion(
        t=np.array([0.0, 1.0]), cylinder_angle=np.array([0.0, 2.0]), guide_z=np.array([0.0, 0.01])
    )
    assert motion.at(0.5) == (pytest.approx(1.0), pytest.approx(0.005))
    assert motion.at(1.5) == (None, None)


def test_what_a_marker_looks_like_and_where_the_camera_looks_are_options(sequence, tmp_path):
    out = tmp_path / "markers.csv"
    words = (
        *(sequence, "--camera", sequence / "camera.yaml", "--motion", sequence / "motion.csv"),
        *("--output", out, "--case", 4, "--no-refine"),
    )
    result = command(track)(*words, "--marker-hue-deg", 300)
    assert result.exit_code == 1
    assert "has the hue of a marker, 300 +- 22 deg" in " ".join(result.output.split())
    result = command(track)(*words, "--camera-tilt-mrad", "1,-2")
    assert result.exit_code == 2
    assert "must be a list of 3 numbers" in result.output
    result = command(track)(*words, "--camera-tilt-mrad", "0.2,0,0", "--fps", 30)
    assert result.exit_code == 0, result.output
    assert "frames.csv has 25 pictures a second, 30 were given: its own are used" in " ".join(
        result.output.split()
    )
