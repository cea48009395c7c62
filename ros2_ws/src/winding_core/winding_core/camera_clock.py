"""What is done about a camera whose clock is off, stated once for the tracker and the commands."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.parameters import parameter
from winding_core.units import PLAIN, SHORT_TIME


@dataclass(frozen=True, kw_only=True)
class CameraClockParameters:
    """Whether the measured offset of the camera's clock is corrected, and how large it may be."""

    camera_clock_correction: bool = parameter(
        False, "whether the measured offset of the camera's clock is applied to later frames", PLAIN
    )
    camera_clock_limit: float = parameter(
        0.25, "largest offset of the camera's clock with which frames are used", SHORT_TIME,
        0.001, 2.0,
    )  # fmt: skip
