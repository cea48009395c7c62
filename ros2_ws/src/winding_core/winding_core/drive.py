"""Drive profile of the machine: both axes ramp linearly, then hold (paper, section 2.1.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from winding_core.helix import FloatOrArray, like
from winding_core.readings import AxisReading

PAPER_ANGULAR_SPEED = 1.74
PAPER_FEED_SPEED = 5.0e-3
PAPER_RAMP_TIME = 1.0
PAPER_DURATION = 20.0


@dataclass(frozen=True, kw_only=True)
class DriveProfile:
    """Speeds of cylinder and carriage over time.

    Attributes:
        angular_speed: Cylinder speed after the ramp, omega_max [rad/s].
        feed_speed: Carriage speed after the ramp, delta_max [m/s]; negative towards -z.
        ramp_time: Time in which both reach their maximum, T_s [s].
    """

    angular_speed: float = PAPER_ANGULAR_SPEED
    feed_speed: float = PAPER_FEED_SPEED
    ramp_time: float = PAPER_RAMP_TIME

    def __post_init__(self) -> None:
        for name in ("angular_speed", "feed_speed", "ramp_time"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ValueError(f"{name} must be finite, got {value}")
        if self.angular_speed <= 0.0:
            raise ValueError(f"angular_speed must be positive, got {self.angular_speed} rad/s")
        if self.ramp_time < 0.0:
            raise ValueError(f"ramp_time must not be negative, got {self.ramp_time} s")

    @property
    def advance_per_radian(self) -> float:
        """Axial advance of the guide per radian of rotation [m/rad]."""
        return self.feed_speed / self.angular_speed

    @property
    def pitch(self) -> float:
        """Axial advance of the guide per turn [m]."""
        return 2.0 * math.pi * self.advance_per_radian

    def fraction(self, t: FloatOrArray) -> FloatOrArray:
        """Return the share of the full speed at time t [s]."""
        times = np.asarray(t, dtype=float)
        if self.ramp_time == 0.0:
            share = np.where(times > 0.0, 1.0, 0.0)
        else:
            share = np.clip(times / self.ramp_time, 0.0, 1.0)
        return like(t, share)

    def full_speed_time(self, t: FloatOrArray) -> FloatOrArray:
        """Return the time [s] at full speed that covers the same way as the profile until t."""
        times = np.maximum(np.asarray(t, dtype=float), 0.0)
        ramp = self.ramp_time
        if ramp == 0.0:
            way = times
        else:
            way = np.where(times < ramp, 0.5 * times * times / ramp, times - 0.5 * ramp)
        return like(t, way)

    def speeds(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """Return (cylinder speed [rad/s], carriage speed [m/s]) at time t."""
        share = self.fraction(t)
        return self.angular_speed * share, self.feed_speed * share

    def positions(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """Return (cylinder angle Theta [rad], carriage position [m]) at time t."""
        way = self.full_speed_time(t)
        return self.angular_speed * way, self.feed_speed * way

    def reading_at(self, t: float) -> AxisReading:
        """Return both axes at time t [s]."""
        (angle, carriage), (speed, feed) = self.positions(t), self.speeds(t)
        return AxisReading(
            cylinder_angle=angle, angular_speed=speed, carriage_position=carriage, feed_speed=feed
        )

    def time_at_angle(self, angle: float) -> float:
        """Return the time [s] at which the cylinder reaches an angle [rad].

        Raises:
            ValueError: The angle is negative.
        """
        if angle < 0.0:
            raise ValueError(f"angle must not be negative, got {angle} rad")
        way = angle / self.angular_speed
        if way < 0.5 * self.ramp_time:
            return math.sqrt(2.0 * way * self.ramp_time)
        return way + 0.5 * self.ramp_time
