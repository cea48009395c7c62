"""`winding run --machine external` with cells that are not as the simulated machine is."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message
from recordings import recorded

from lay_control_node.ros.parameters import LayControlParameters
from processes import in_namespace, running
from winding_core.markers import MARKER_DTYPE, MarkerFlag
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.diagnostics import decode_diagnostics

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(900)]

CELL = Path(__file__).with_name("camera_cell.py")
NAMESPACE = "cell"
DURATION = 12.0  # P2 of case 4 has landed and has been seen by then [s]
# What the paper measured of P1 and P2 of case 4, which is what the cell winds [m].
MEASURED = (0.10685, 0.21336)
NEAR = 2.0e-3  # Issue's bar for encoders and cameras with losses, delays and pauses
# A record with one of these brings no measured length.
UNSEEN = int(MarkerFlag.OCCLUDED | MarkerFlag.NOT_WOUND | MarkerFlag.PREDICTED)
REVERSED = ("--cylinder-scale", -1.0, "--carriage-scale", -1.0)
# Pauses with frames while P1 is in view, and without while P2 is; lengths are means over all
# frames, so one frame of another turn shows.
PAUSES = [{"pauses": [(5.0, pause, True), (6.1, pause, False)]} for pause in (0.5, 3.0, 30.0)]
CORRECTED = ("--camera-clock-correction", "--camera-clock-limit-ms", 300)
COMMANDED_CELL = Path(__file__).with_name("commanded_cell.py")
ADVANCE = LayControlParameters().resolved().drive.advance_per_radian


@pytest.fixture
def cell(request: pytest.FixtureRequest) -> Iterator[None]:
    """Run a cell that differs from the ideal one as the test asks."""
    with running(CELL, json.dumps(request.param), *in_namespace(NAMESPACE), ready="ready"):
        yield


@pytest.fixture
def wind(cell: None, tmp_path: Path, command: Any) -> Callable[..., list[float]]:
    """Wind case 4 with the cell; return the tracked lengths [m]."""

    def run(*further: object) -> list[float]:
        command(
            *("run", "--case", 4, "--machine", "external", "--namespace", NAMESPACE),
            *("--duration-s", DURATION, "--output", tmp_path / "run", *further),
            cwd=tmp_path, code=0,
        )  # fmt: skip
        numbers = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
        return [marker["s_tracked_m"] for marker in numbers["markers"][:2]]

    return run


@pytest.mark.parametrize(
    ("cell", "options"),
    [
        ({}, ()),
        ({"angle": 37.2, "carriage": 0.1, "reversed": True}, REVERSED),
        ({"joint_rate": 100.0, "velocities": False, "loss": 0.05, "jitter": 0.02}, ()),
        *((pause, ()) for pause in PAUSES),
        # At a steady speed an offset shifts all bands alike; what it would change in the ramp is
        # withheld.
        *(({"camera_offset": offset}, CORRECTED) for offset in (0.05, -0.2)),
        *(({"camera_offset": offset}, ()) for offset in (0.05, -0.005)),
    ],
    indirect=["cell"],
    ids=str,
)
def test_markers_are_measured_where_they_lie(wind: Any, options: tuple[object, ...]) -> None:
    assert wind(*options) == pytest.approx(MEASURED, rel=NEAR)


@pytest.mark.parametrize("cell", [{"camera_offset": 0.083}], indirect=True, ids=str)
def test_the_trace_follows_frames_stamped_ahead_of_exposure(wind: Any, tmp_path: Path) -> None:
    wind(*CORRECTED, "--trace", tmp_path / "trace.json")
    trace = json.loads((tmp_path / "trace.json").read_text(encoding="utf-8"))
    ways: dict[str, list[float]] = {"camera": [], "prediction": []}
    for event in trace["traceEvents"]:
        if event["ph"] == "b" and event["name"] == "corrected length":
            ways[event["cat"]].append(event["args"]["stamp_s"])
    assert trace["otherData"] == {
        "lengths": len(ways["prediction"]),
        **{way: len(stamps) for way, stamps in ways.items()},
    }
    followed = [t for t in ways["prediction"] if t >= min(ways["camera"])]
    assert sorted(ways["camera"]) == sorted(followed)
    # Predictions come at 50 Hz, and the camera is there from the start on.
    assert len(followed) > 45 * DURATION


# At a steady speed the offset is hidden in the shift of P0; what it hides comes out at standstill.
@pytest.mark.parametrize(
    "cell",
    [{"camera_offset": offset, "pauses": [(6.1, 3.0, True)]} for offset in (0.05, -0.05)],
    indirect=True,
    ids=str,
)
def test_a_length_that_the_clock_falsifies_is_published_under_the_warning(
    request: pytest.FixtureRequest, wind: Any, tmp_path: Path
) -> None:
    wind("--bag", tmp_path / "bag")
    warned = [
        t
        for data in recorded(tmp_path / "bag", topics.DIAGNOSTICS.name)
        for t, statuses in [decode_diagnostics(deserialize_message(data, DiagnosticArray))]
        if any("lengths may be wrong" in status.message for status in statuses)
    ]
    offset = request.node.callspec.params["cell"]["camera_offset"]
    wrong = [
        t - offset
        for cloud in recorded(tmp_path / "bag", topics.TRACKED_MARKERS.name)
        for t, markers in [decode_cloud(cloud, MARKER_DTYPE)]
        for marker in markers[(markers["flags"] & UNSEEN) == 0]
        if marker["id"] in (1, 2)
        and marker["s"] != pytest.approx(MEASURED[marker["id"] - 1], rel=NEAR)
    ]
    # A length is published after its frame's exposure.
    assert warned
    assert not wrong or min(warned) < min(wrong)


@pytest.mark.parametrize("cell", [{"frame_rate": 0.0, "joint_rate": 100.0}], indirect=True, ids=str)
def test_a_camera_in_the_trackers_process_hands_its_frames_over(
    wind: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera, film = CELL.with_name("film_camera.py"), tmp_path / "film.npy"
    subprocess.run([sys.executable, str(camera), str(film), "8", "200"], check=True)
    monkeypatch.setenv("WINDING_FILM", str(film))
    bag = tmp_path / "bag"
    lengths = wind("--duration-s", 7, "--bag", bag, "--compose", f"{camera}:open_camera")
    frames = len(recorded(bag, topics.CAMERA_INFO.name))
    assert len(recorded(bag, topics.TRACKED_MARKERS.name)) == frames > 700
    assert lengths[0] == pytest.approx(MEASURED[0], rel=NEAR)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_markers_of_another_cell_land_on_the_helix(seed: int, tmp_path: Path, command: Any) -> None:
    truth = tmp_path / "truth.json"
    with running(COMMANDED_CELL, seed, truth, *in_namespace(NAMESPACE), ready="ready"):
        command(
            *("run", "--case", 4, "--machine", "external", "--namespace", NAMESPACE),
            *("--cylinder-joint", "spindle", "--carriage-joint", "slide"),
            *("--carriage-scale", -0.001, "--control", "drive", "--duration-s", 13),
            *("--output", tmp_path / "run"),
            cwd=tmp_path, code=0,
        )  # fmt: skip
    lay = json.loads(truth.read_text(encoding="utf-8"))
    theta, z = np.array(lay["theta"]), np.array(lay["z"])
    markers = np.array([angle for angle in lay["markers"] if angle < theta[-1]])
    assert markers.size >= 3
    error = np.abs(np.interp(markers, theta, z) - ADVANCE * markers)
    # The limits of the project's own hidden rigs: 1.0 mm at P1 and P2, 0.5 mm from P3 on.
    assert (error < np.array([1.0e-3, 1.0e-3, *[0.5e-3] * (markers.size - 2)])).all(), error
