"""Options of a run that several nodes and commands share, each record declared once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

from winding_core.error_verdict import ErrorLimit
from winding_core.lay.errors import LayTolerance
from winding_core.parameters import parameter
from winding_core.raw_image import ENCODINGS
from winding_core.units import LENGTH, PLAIN, ROW_TIME, SHORT_TIME, SMALL_ANGLE


@dataclass(frozen=True, kw_only=True)
class CameraPlacement:
    """Extrinsics of the camera: nominally it faces -x, image right +z, image down +y."""

    camera_position: list[float] = parameter(
        [0.4175, 0.0, 0.05], "camera position in winder_axis", LENGTH, -10.0, 10.0
    )
    camera_tilt: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "rotation of the camera from facing -x, image right +z, image down +y",
        SMALL_ANGLE,
        -0.5,
        0.5,
    )


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


@dataclass(frozen=True, kw_only=True)
class CameraPixels:
    """What the stream does not state about its pixels, or states wrongly."""

    encoding: str = parameter(
        "", "how the pixels are encoded, whatever the pictures say", PLAIN,
        choices=("", *ENCODINGS),
    )  # fmt: skip
    significant_bits: int = parameter(
        0, "bits that count in words of 16 bits, from the lowest", PLAIN, 8, 16, otherwise="16"
    )
    row_time: float = parameter(
        0.0,
        "time from a row of the picture to the next of a rolling shutter, negative where the "
        "lowest row is read first; the stamp is that of the row read first",
        ROW_TIME,
        -0.001,
        0.001,
    )


@dataclass(frozen=True, kw_only=True)
class LayParameters:
    """What is measured beside the markers."""

    measure_lay: bool = parameter(True, "whether every turn on the cylinder is measured", PLAIN)


@dataclass(frozen=True, kw_only=True)
class LayWish:
    """Where the cable is wanted, and whether the controller drives the machine for it."""

    control: str = parameter(
        "watch",
        "mode in which the lay controller begins: off, watch (reports its commands only) or drive",
        PLAIN,
        choices=("off", "watch", "drive"),
    )
    program: str = parameter(
        "", "lay program: a file of CSV, YAML or G-code; empty for an even helix", PLAIN
    )
    pitch: float = parameter(
        0.0,
        "axial advance per turn of the even helix",
        LENGTH,
        -1.0,
        1.0,
        otherwise="the drive programme's",
    )
    markers_every_turn: bool = parameter(
        False, "whether marker n is wanted after n turns; needs a brake", PLAIN
    )
    brake: bool = parameter(False, "whether the machine has a brake that takes commands", PLAIN)


# Component of the page's status that carries the limits.
COMPONENT = "limits"


@dataclass(frozen=True, kw_only=True)
class OperatorLimits(ErrorLimit, LayTolerance):
    """How far off a corrected length and a turn may be."""

    @classmethod
    def from_values(cls, values: Mapping[str, str]) -> Self | None:
        """Return the limits that diagnostics carry; None where they carry none."""
        try:
            return cls(**{item.name: float(values[item.name]) for item in fields(cls)})
        except (KeyError, ValueError):
            return None

    def values(self) -> dict[str, str]:
        """Return the limits as values of a status, to the last digit."""
        return {name: repr(value) for name, value in vars(self).items()}
