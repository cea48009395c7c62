"""Recorded motion, photographs, and the file of measurements."""

import csv
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from marker_tracker_node.arrays import ByteArray, FloatArray
from winding_core.markers import Markers

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
MOTION_COLUMNS = ("t", "cylinder_angle", "guide_z")
MEASURED = ("theta", "z", "s", "sigma_theta", "sigma_z")


class RecordingError(ValueError):
    """A recording cannot be read."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Encoder readings of a run."""

    t: FloatArray  # Ascending times [s], shape (k,)
    cylinder_angle: FloatArray  # [rad], shape (k,)
    guide_z: FloatArray  # [m], shape (k,)

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if not np.isfinite(values).all():
                raise RecordingError(f"{name} of a motion must be finite")
        if self.t.size < 1 or not (np.diff(self.t) > 0.0).all():
            raise RecordingError(f"motion times must ascend, got {self.t.size} of them")

    def at(self, t: float) -> tuple[float | None, float | None]:
        """Return cylinder angle and guide position at a time, or None outside the readings."""
        if not self.t[0] <= t <= self.t[-1]:
            return None, None
        return (
            float(np.interp(t, self.t, self.cylinder_angle)),
            float(np.interp(t, self.t, self.guide_z)),
        )


def read_motion(path: Path) -> Motion:
    """Read a CSV with the columns t, cylinder_angle, guide_z (SI).

    Raises:
        RecordingError: The file cannot be read or lacks a column.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        columns = [np.array([float(row[name]) for row in rows]) for name in MOTION_COLUMNS]
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from error
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        raise RecordingError(
            f"{path} must have the columns {', '.join(MOTION_COLUMNS)} with numbers: {error!r}"
        ) from error
    return Motion(t=columns[0], cylinder_angle=columns[1], guide_z=columns[2])


def read_picture(path: Path) -> ByteArray:
    """Return a picture, blue-green-red.

    Raises:
        RecordingError: It cannot be read.
    """
    frame = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if frame is None:
        raise RecordingError(f"{path} is not a picture")
    return np.asarray(frame, dtype=np.uint8)


def write_measurements(path: Path, rows: list[tuple[float, Markers]]) -> None:
    """Write one line per frame and marker: t, id, theta, z, s, sigma_theta, sigma_z, flags."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "id", *MEASURED, "flags"])
        for t, markers in rows:
            for marker in markers:
                numbers = [f"{float(marker[name]):.9g}" for name in MEASURED]
                writer.writerow([f"{t:.9f}", int(marker["id"]), *numbers, int(marker["flags"])])
