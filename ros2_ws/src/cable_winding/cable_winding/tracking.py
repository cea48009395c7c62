"""Measure the markers in a film."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cable_winding.prediction import Markers
from marker_tracker_node import FrameSource, Tracker, TrackerConfig, read_camera, read_motion
from marker_tracker_node.camera.frame_sources import Recording, is_bag, read_bag
from winding_core.cable.condition import Condition

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """Markers measured in a film.

    Attributes:
        markers: P0, P1, ... in the last frame; NaN while unknown.
        pixels: Their position in that frame, column and row [px], shape (n, 2).
        frame: The last frame, blue-green-red, shape (rows, columns, 3), dtype uint8.
        t: Times of the frames [s], shape (m,).
        theta: Wound angle of P0, P1, ... over time [rad], shape (m, count + 1); NaN while unknown.
        z: Axial position over time [m], shape (m, count + 1); NaN while unknown.
        s: Length from P0 over time [m], shape (m, count + 1); NaN while unknown.
        flags: Bits of `MarkerFlag` over time, shape (m, count + 1); NOT_WOUND while unknown.
        warnings: What contradicts the expected lay, one sentence each.
    """

    markers: Markers
    pixels: FloatArray
    frame: NDArray[np.uint8]
    t: FloatArray
    theta: FloatArray
    z: FloatArray
    s: FloatArray
    flags: NDArray[np.int64]
    warnings: tuple[str, ...]


def track(
    film: str | PathLike[str],
    condition: Condition,
    *,
    camera: str | PathLike[str] | None = None,
    motion: str | PathLike[str] | None = None,
    fps: float | None = None,
) -> Tracking:
    """Measure where the markers of a film lie on the cylinder.

    Camera clock and pose are taken as given; `winding track` estimates them as well.

    Args:
        film: Video file, folder of images, or recording (bag).
        condition: What is wound.
        camera: Calibration (.yaml); None for the recording's own.
        motion: Encoder readings (.csv: t, cylinder_angle, guide_z); None for the recording's own.
        fps: Frame rate of images without times, or in place of a video's own times [1/s].

    Returns:
        The markers in the last frame and over time.

    Raises:
        ValueError: There is no camera, no motion or no usable frame, or a file cannot be read.
    """
    source = Path(film)
    own = read_bag(source) if is_bag(source) else Recording(camera=None, motion=None)
    lens = own.camera if camera is None else read_camera(Path(camera))
    drive = own.motion if motion is None else read_motion(Path(motion))
    if lens is None or drive is None:
        missing = "camera" if lens is None else "motion"
        raise ValueError(f"{source} brings no {missing}: give {missing}=")
    tracker = Tracker(TrackerConfig.of(condition.resolved()), lens)
    times, rows, last = [], [], None
    for t, frame in FrameSource(source, fps=fps):
        found = tracker.track(frame, t, *drive.at(t))
        if len(found):
            times.append(t)
            rows.append(found)
            last = frame
    if last is None:
        raise ValueError(f"{source} has no usable frame")
    history = np.stack(rows)
    return Tracking(
        markers=Markers.from_records(history[-1]),
        pixels=tracker.lens.pixels(history[-1], tracker.pose),
        frame=last,
        t=np.array(times),
        theta=np.array(history["theta"]),
        z=np.array(history["z"]),
        s=np.array(history["s"]),
        flags=history["flags"].astype(np.int64),
        warnings=tracker.report().doubts,
    )
