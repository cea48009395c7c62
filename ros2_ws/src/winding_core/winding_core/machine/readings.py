"""What the machine's sensors report at one instant."""

import math
from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, kw_only=True, slots=True)
class GuidePlace:
    """Where the guide's eye stands across the cylinder's axis, in `winder_axis`."""

    x: float  # [m]
    y: float  # [m]

    @classmethod
    def beside(cls, radius: float, free_length: float) -> Self:
        """Return the place from which cable lands at azimuth zero.

        Args:
            radius: Of its centre line there [m].
            free_length: Of the span [m].
        """
        return cls(x=radius, y=-free_length)

    def free_length(self, radius: float) -> float:
        """Return the tangent span from a centre line's radius [m] to the eye [m].

        Raises:
            ValueError: The eye does not stand outside that radius.
        """
        off = math.hypot(self.x, self.y)
        if not off > radius:
            raise ValueError(
                f"the guide must stand more than {radius:.4g} m off the axis, where the cable "
                f"lies, got {off:.4g} m"
            )
        return math.sqrt((off - radius) * (off + radius))

    def landing(self, radius: float) -> float:
        """Return the azimuth [rad] at which cable lands at a radius [m]; errors as above."""
        return math.atan2(self.y, self.x) + math.atan2(self.free_length(radius), radius)


@dataclass(frozen=True, kw_only=True)
class AxisReading:
    """Cylinder and carriage, measured or commanded."""

    cylinder_angle: float  # Theta [rad], unwrapped.
    angular_speed: float  # [rad/s]
    carriage_position: float  # Way of the guide along +z since the start [m].
    feed_speed: float  # [m/s]
    # Across the axis; None for a guide that keeps the place that its free length gives it.
    guide: GuidePlace | None = None

    @property
    def numbers(self) -> tuple[float, float, float, float]:
        """Angle, its speed, position of the carriage, its speed."""
        return self.cylinder_angle, self.angular_speed, self.carriage_position, self.feed_speed

    @classmethod
    def of_positions(cls, cylinder_angle: float, carriage_position: float) -> Self:
        """Return a reading of positions [rad], [m] without speeds, which are nan."""
        return cls(
            cylinder_angle=cylinder_angle,
            angular_speed=math.nan,
            carriage_position=carriage_position,
            feed_speed=math.nan,
        )


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
