"""An arm's file opened for one condition, where Pinocchio is installed."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.condition import ResolvedCondition

if TYPE_CHECKING:
    from winding_core.arm.arm_path import ArmPath

NOT_INSTALLED = (
    "the arm's kinematics need Pinocchio: install the extra arm "
    "(pip install 'cable-winding-twin[ros,arm]'), or ros-jazzy-pinocchio"
)


def open_arm(file: str, what: ResolvedCondition) -> ArmPath | None:
    """Return the way on which an arm carries the guide of a condition; see `arm_beside`."""
    return arm_beside(file, what.case.centreline_radius, what.free_length)


def arm_beside(file: str, radius: float, free_length: float) -> ArmPath | None:
    """Return the way on which an arm carries the guide; None without a file.

    Args:
        file: Of the arm, see docs/arm.md; empty for a linear carriage.
        radius: Of the centre line of cable on the cylinder [m].
        free_length: Of the span where the file gives none [m].

    Raises:
        MappingError: The file cannot be used, or Pinocchio is not installed.
        ValueError: Description or start cannot be used.
    """
    if not file:
        return None
    # A machine without an arm begins without SciPy.
    from winding_core.arm.arm_file import MappingError, read_mapping  # noqa: PLC0415

    mapping = read_mapping(Path(file))
    try:
        arm_path = importlib.import_module("winding_core.arm.arm_path")
    except ImportError as error:
        if error.name != "pinocchio":
            raise
        raise MappingError(NOT_INSTALLED) from None
    if not mapping.guide.urdf:
        raise MappingError(f"{file}: a simulated arm needs the urdf of guide")
    made: ArmPath = arm_path.ArmPath(mapping, radius, free_length)
    return made


def check_arm(
    path: ArmPath | None, what: ResolvedCondition, guide: NDArray[np.float64], speed: float
) -> None:
    """Refuse a motion on which an arm cannot lead the guide; nothing without an arm.

    Args:
        path: Of the arm, see `open_arm`.
        what: Is wound.
        guide: Places to which the guide goes along the axis [m], any shape.
        speed: Its largest speed on the way [m/s].

    Raises:
        ValueError: Travel, reach, joints or the cylinder forbid it.
    """
    if path is not None:
        low, high = float(np.min(guide, initial=0.0)), float(np.max(guide, initial=0.0))
        path.check(low, high, abs(speed), what.case.cylinder_radius)
