"""What the machine's sensors say at one instant."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class AxisReading:
    """Cylinder and carriage, measured or commanded.

    Attributes:
        cylinder_angle: Theta [rad], unwrapped.
        angular_speed: [rad/s]
        carriage_position: Way of the guide along +z since the start [m].
        feed_speed: [m/s]
    """

    cylinder_angle: float
    angular_speed: float
    carriage_position: float
    feed_speed: float


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What a sensor of the machine measures, one number at a time.

    Attributes:
        name: Such as tension.
        unit: Of the number, SI.
        sensor: What measures it; the frame of its messages.
        field: Where the number stands in a message, with dots between nested fields.
        digits: Decimals that an operator reads.
    """

    name: str
    unit: str
    sensor: str
    field: str
    digits: int = 2


CABLE_TENSION = Quantity(name="tension", unit="N", sensor="load_cell", field="wrench.force.x")


@dataclass(frozen=True, kw_only=True)
class ImageWindow:
    """The part of the full sensor that a frame shows (REP-104).

    Attributes:
        x_offset: Left edge in full-resolution pixels.
        y_offset: Top edge in full-resolution pixels.
        width: Full-resolution width; 0 means the whole sensor.
        height: Full-resolution height; 0 means the whole sensor.
        binning: Full-resolution pixels per frame pixel along each side.
    """

    x_offset: int = 0
    y_offset: int = 0
    width: int = 0
    height: int = 0
    binning: int = 1
