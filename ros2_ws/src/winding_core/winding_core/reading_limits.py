"""What a machine's readings can be: a reader refuses the rest before it acts on it."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.drive import PAPER_ANGULAR_SPEED, PAPER_FEED_SPEED
from winding_core.readings import AxisReading

# Rounding of stamps and the encoder's own step, as a way of each axis [rad, m].
_SLACK = (0.02, 1.0e-4)


@dataclass(frozen=True, kw_only=True)
class ReadingLimits:
    """Limits of one run's readings, generous against what a healthy machine says.

    Attributes:
        weight: Dead weight on the cable [N].
        angular_speed: Full speed of the cylinder [rad/s]; the sign does not count.
        feed_speed: Full speed of the carriage [m/s]; the sign does not count.
        tension_factor: Largest tension, as a share of the weight.
        speed_factor: Largest speed, as a share of full speed.
    """

    weight: float
    angular_speed: float
    feed_speed: float
    tension_factor: float = 5.0
    speed_factor: float = 3.0

    def against_tension(self, force: float) -> str:
        """Return why a tension [N] cannot be, or nothing."""
        high = self.tension_factor * self.weight
        if force > high:
            return f"tension must be at most {high:.3g} N, got {force:.3g} N"
        return ""

    def against_motion(
        self, t: float, reading: AxisReading, before: tuple[float, AxisReading] | None
    ) -> str:
        """Return why a reading at t [s] cannot follow the one before it, or nothing."""
        # An axis that the programme lets stand may be moved by commands.
        axes = (
            ("cylinder", reading.angular_speed, abs(self.angular_speed) or PAPER_ANGULAR_SPEED),
            ("carriage", reading.feed_speed, abs(self.feed_speed) or PAPER_FEED_SPEED),
        )
        for name, speed, full in axes:
            if abs(speed) > self.speed_factor * full:
                return (
                    f"{name} must not be faster than {self.speed_factor * full:.3g}, "
                    f"got {speed:.3g}"
                )
        if before is None:
            return ""
        last_t, last = before
        ways = (
            reading.cylinder_angle - last.cylinder_angle,
            reading.carriage_position - last.carriage_position,
        )
        for (name, _, full), way, slack in zip(axes, ways, _SLACK, strict=True):
            reach = self.speed_factor * full * max(t - last_t, 0.0) + slack
            if abs(way) > reach:
                return f"{name} jumped by {way:.3g} within {t - last_t:.3g} s"
        return ""
