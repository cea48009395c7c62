"""The tracker beside a classic OpenCV pipeline in the same gates, and beside reading their pixels.

One turn of case 4 in the live window: every marker comes into sight and goes.
"""

from __future__ import annotations

import copy
import math
from typing import Any

import cv2
import numpy as np
import pytest

from floors.classic_tracker import ClassicTracker
from floors.films import DRIVE, live_scene
from floors.gates import Box, boxes_of
from rows import costs, least
from winding_core.compiling import compiled
from winding_core.markers import Markers
from winding_core.units import MILLIMETRE
from winding_rig_node.camera import CameraConfig

UNSEEN = 48
BEGIN, RATE = 14.91, 100.0
ROUNDS = 5
# Measured 0.40 to 0.41 where all five markers are in sight, 0.19 to 0.20 and 5.1 to 6.0 in a burst,
# each in five sessions on two shared cores; the rest is for other processors.
FRAME_OVER_CLASSIC = 1.2
BURST_OVER_CLASSIC = 0.4
BURST_OVER_READING = 6.0
# Measured 0.24, which is the same on every computer but for rounding.
ERROR_OVER_CLASSIC = 0.3


@compiled
def read_boxes(frames: np.ndarray, boxes: np.ndarray) -> int:
    """Return the sum of every byte in boxes (k, 5): frame, top, bottom, left, right."""
    total = 0
    for k in range(boxes.shape[0]):
        frame, top, bottom, left, right = boxes[k]
        for v in range(top, bottom):
            line = frames[frame, v]
            for u in range(left, right):
                total += line[u, 0] + line[u, 1] + line[u, 2]
    return total


def rms(errors: list[float]) -> float:
    """Return the root of the mean square of errors [m], in millimetres."""
    return float(np.sqrt(np.mean(np.square(errors)))) / MILLIMETRE


@pytest.mark.timeout(600)
def test_tracker_beside_the_classic_pipeline_in_its_gates(bench: Any) -> None:
    cv2.setNumThreads(1)
    shown, tracker = live_scene(CameraConfig(), BEGIN - 0.01)
    case = shown.case
    turn = 2.0 * math.pi / DRIVE.speeds(BEGIN)[0]
    rows = list(shown.frames(RATE, start=BEGIN, stop=BEGIN + turn))
    times, frames, angles, guides = (np.array(part) for part in zip(*rows, strict=True))
    count = len(frames)

    boxes: list[list[Box]] = []
    looking = copy.deepcopy(tracker)
    for k in range(count):
        boxes.append(boxes_of(looking, frames[k], angles[k]))
        looking.track(frames[k], times[k], angles[k], guides[k])
    places = np.array(
        [
            (k, box.top, box.bottom, box.left, box.right)
            for k, here in enumerate(boxes)
            for box in here
        ]
    )

    def follow() -> tuple[np.ndarray, list[Markers]]:
        fresh = copy.deepcopy(tracker)
        return costs(count, lambda k: fresh.track(frames[k], times[k], angles[k], guides[k]))

    def pipe() -> tuple[np.ndarray, list[dict[int, tuple[float, float]]]]:
        fresh = ClassicTracker(
            shown.camera.calibration(),
            shown.camera.position,
            case.cylinder_radius,
            case.cable_radius,
        )
        return costs(count, lambda k: fresh.track(frames[k], angles[k], boxes[k]))

    def track_burst() -> np.ndarray:
        fresh = copy.deepcopy(tracker)
        return costs(1, lambda _: fresh.process(frames, times, angles, guides))[0]

    ours, theirs = follow()[1], pipe()[1]
    tracked, piped, burst, reading = least(
        ROUNDS,
        lambda: follow()[0],
        lambda: pipe()[0],
        track_burst,
        lambda: costs(1, lambda _: read_boxes(frames, places))[0],
    )
    burst_frame, read_frame = float(burst[0]) / count, float(reading[0]) / count

    def off(n: int, theta: float, z: float) -> float:
        return math.hypot(case.centreline_radius * (theta - shown.theta[n]), z - shown.z[n])

    # P0 is where both begin; where only one of them sees a marker there is nothing to compare.
    errors = [
        (off(n, *theirs[k][n]), off(n, float(ours[k]["theta"][n]), float(ours[k]["z"][n])))
        for k in range(count)
        for n in range(1, case.marker_count + 1)
        if n in theirs[k] and not ours[k]["flags"][n] & UNSEEN
    ]
    seen = sum(int(((k["flags"][1:] & UNSEEN) == 0).sum()) for k in ours)
    assert len(errors) > 0.5 * seen
    theirs_off, ours_off = (rms(list(column)) for column in zip(*errors, strict=True))
    pixels = (places[:, 2] - places[:, 1]) * (places[:, 4] - places[:, 3])
    all_seen = np.array([len(here) == case.marker_count + 1 for here in boxes])
    assert all_seen.any()
    bench.row("tracker_gated_pixels_per_frame", float(pixels.sum()) / count, "px")
    bench.row("tracker_error_rms_mm", ours_off, "mm")
    bench.row("classic_in_gates_error_rms_mm", theirs_off, "mm")
    bench.ratio("tracker_frame_over_reading_its_gates", tracked.mean(), read_frame)
    bench.ratio("tracker_frame_over_classic_in_gates", tracked.mean(), piped.mean())
    bench.row("tracker_error_over_classic", ours_off / theirs_off, "", bar=ERROR_OVER_CLASSIC)
    bench.ratio(
        "tracker_frame_over_classic_in_sight",
        tracked[all_seen].mean(),
        piped[all_seen].mean(),
        bar=FRAME_OVER_CLASSIC,
    )
    bench.ratio(
        "tracker_burst_over_classic_in_gates", burst_frame, piped.mean(), bar=BURST_OVER_CLASSIC
    )
    bench.ratio(
        "tracker_burst_over_reading_its_gates", burst_frame, read_frame, bar=BURST_OVER_READING
    )
