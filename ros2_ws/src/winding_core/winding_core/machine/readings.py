"""What the machine's sensors report at one instant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, kw_only=True)
class AxisReading:
    """Cylinder and carriage, measured or commanded."""

    cylinder_angle: float  # Theta [rad], unwrapped.
    angular_speed: float  # [rad/s]
    carriage_position: float  # Way of the guide along +z since the start [m].
    feed_speed: float  # [m/s]

    @classmethod
    def of_positions(cls, cylinder_angle: float, carriage_position: float) -> Self:
        """Return a reading of positions [rad], [m] without speeds, which are nan."""
        speeds = {"angular_speed": math.nan, "feed_speed": math.nan}
        return cls(cylinder_angle=cylinder_angle, carriage_position=carriage_position, **speeds)


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What a sensor of the machine measures, one number at a time."""

    name: str  # Such as tension.
    unit: str  # Of the number, SI.
    sensor: str  # What measures it; the frame of its messages.
    field: str  # Where the number stands in a message, with dots between nested fields.
    digits: int = 2  # Decimals that an operator reads.


CABLE_TENSION = Quantity(name="tension", unit="N", sensor="load_cell", field="wrench.force.x")


@dataclass(frozen=True, kw_only=True)
class ImageWindow:
    """The part of the full sensor that a frame shows (REP-104)."""

    x_offset: int = 0  # Left edge in full-resolution pixels.
    y_offset: int = 0  # Top edge in full-resolution pixels.
    width: int = 0  # Full-resolution width; 0 means the whole sensor.
    height: int = 0  # Full-resolution height; 0 means the whole sensor.
    binning: int = 1  # Full-resolution pixels per frame pixel along each side.
