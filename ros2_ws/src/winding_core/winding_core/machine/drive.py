"""Drive programmes: speed ramps of both axes, with or without a turning point."""

import math
from dataclasses import dataclass

import numpy as np

from winding_core.helix import FloatOrArray, like
from winding_core.machine.readings import AxisReading
from winding_core.units import MILLIMETRE

PAPER_ANGULAR_SPEED = 1.74
PAPER_FEED_SPEED = 5.0e-3
PAPER_RAMP_TIME = 1.0
PAPER_DURATION = 20.0


@dataclass(frozen=True, kw_only=True)
class DriveProfile:
    """Speeds of cylinder and carriage over time."""

    angular_speed: float = PAPER_ANGULAR_SPEED  # Cylinder speed after the ramp, omega_max [rad/s].
    # Carriage speed after the ramp, delta_max [m/s]; negative towards -z.
    feed_speed: float = PAPER_FEED_SPEED
    ramp_time: float = PAPER_RAMP_TIME  # Time in which both reach their maximum, T_s [s].

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


@dataclass(frozen=True, kw_only=True)
class TurningDrive(DriveProfile):
    """A drive profile whose guide turns back at a position, and which unwinds from a time on.

    The guide goes from feed to feed backwards as quickly as it comes from standstill to feed, with
    the cylinder at full speed, so that it turns at the position. Unwinding turns both axes back
    along the same way, from full speed to full speed backwards in twice the ramp time.
    """

    # Carriage position at which the guide turns back [m], with the sign of the feed; None for a
    # guide that never does.
    guide_turns_at: float | None = None
    unwinds_from: float | None = None  # Time at which both axes begin to turn back [s]; None: never

    def __post_init__(self) -> None:
        super().__post_init__()
        place, nearest = self.guide_turns_at, 0.5 * self.feed_speed * self.ramp_time
        if place is not None and not (
            math.isfinite(place) and self.feed_speed != 0.0 and place / self.feed_speed > 0.0
        ):
            raise ValueError(
                f"the guide cannot turn back at {place / MILLIMETRE:g} mm with a feed of "
                f"{self.feed_speed / MILLIMETRE:g} mm/s: it never gets there"
            )
        if place is not None and abs(place) < abs(nearest):
            raise ValueError(
                f"the guide can turn back at {nearest / MILLIMETRE:g} mm or further, where it can "
                f"come to rest within {self.ramp_time:g} s, got {place / MILLIMETRE:g} mm"
            )
        begin = self.unwinds_from
        if begin is not None and not (math.isfinite(begin) and begin >= self.ramp_time):
            raise ValueError(
                f"unwinding can begin from the end of the ramp at {self.ramp_time:g} s on, "
                f"got {begin:g} s"
            )

    @property
    def longest(self) -> float:
        """Time at which everything is unwound again [s]; infinite for a drive that only winds."""
        if self.unwinds_from is None:
            return math.inf
        # Back at full speed takes the way out; turning takes two ramps and leads to where it began.
        return (
            self.unwinds_from
            + 2.0 * self.ramp_time
            + float(self.full_speed_time(self.unwinds_from))
        )

    def fraction(self, t: FloatOrArray) -> FloatOrArray:
        """Return the share of the full speed at time t [s], negative where it unwinds."""
        share = np.asarray(super().fraction(t), dtype=float)
        if self.unwinds_from is not None:
            after = np.asarray(t, dtype=float) - self.unwinds_from
            if self.ramp_time == 0.0:
                back = np.where(after > 0.0, 2.0, 0.0)
            else:
                back = np.clip(after / self.ramp_time, 0.0, 2.0)
            share = share - back
        return like(t, share)

    def full_speed_time(self, t: FloatOrArray) -> FloatOrArray:
        """Return the time [s] at full speed that covers the same way as the profile until t."""
        way = np.asarray(super().full_speed_time(t), dtype=float)
        if self.unwinds_from is not None:
            ramp = self.ramp_time
            after = np.maximum(np.asarray(t, dtype=float) - self.unwinds_from, 0.0)
            turning = np.minimum(after, 2.0 * ramp)
            lost = 2.0 * (after - turning)
            if ramp > 0.0:
                lost = lost + 0.5 * turning**2 / ramp
            way = way - lost
        return like(t, way)

    def speeds(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """Return (cylinder speed [rad/s], carriage speed [m/s]) at time t."""
        share = self.fraction(t)
        feed = like(t, np.asarray(self._guide(np.asarray(self.full_speed_time(t)))[1]))
        return self.angular_speed * share, feed * share

    def positions(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """Return (cylinder angle Theta [rad], carriage position [m]) at time t."""
        way = self.full_speed_time(t)
        return self.angular_speed * way, like(t, np.asarray(self._guide(np.asarray(way))[0]))

    def time_at_angle(self, angle: float) -> float:
        """Return the time [s] at which the cylinder first reaches an angle [rad].

        Raises:
            ValueError: The angle is negative, or the cylinder turns back before.
        """
        time = super().time_at_angle(angle)
        if self.unwinds_from is None or time <= self.unwinds_from:
            return time
        left = angle / self.angular_speed - float(self.full_speed_time(self.unwinds_from))
        reach = 0.5 * self.ramp_time
        if left > reach:
            highest = self.angular_speed * float(
                self.full_speed_time(self.unwinds_from + self.ramp_time)
            )
            raise ValueError(f"the cylinder turns back at {highest:g} rad, before {angle:g} rad")
        return self.unwinds_from + self.ramp_time - math.sqrt(2.0 * self.ramp_time * (reach - left))

    def _guide(self, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (position [m], speed with the cylinder at full speed [m/s]) of the guide."""
        feed, place, ramp = self.feed_speed, self.guide_turns_at, self.ramp_time
        if place is None:
            return feed * way, np.full(way.shape, feed)
        begin = place / feed - 0.5 * ramp
        after = np.maximum(way - begin, 0.0)
        turning = np.minimum(after, 2.0 * ramp)
        if ramp == 0.0:
            return feed * (way - 2.0 * after), np.where(after > 0.0, -feed, feed)
        lost = 0.5 * turning**2 / ramp + 2.0 * (after - turning)
        return feed * (way - lost), feed * (1.0 - turning / ramp)
