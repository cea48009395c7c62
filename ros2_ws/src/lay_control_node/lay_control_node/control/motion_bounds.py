"""Bounds of a commanded axis: travel, speed, acceleration; no command leaves them."""

from __future__ import annotations

import math
from dataclasses import dataclass

# Share of the acceleration with which an axis is planned to stop; the rest is reserve.
_BRAKING_SHARE = 0.8


@dataclass(frozen=True, kw_only=True)
class AxisBounds:
    """What the machine allows an axis [SI].

    Attributes:
        low: Start of its travel.
        high: End of its travel.
        speed: Largest speed.
        acceleration: Largest acceleration.
    """

    low: float
    high: float
    speed: float
    acceleration: float

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"travel must end above its start, got {self.low} to {self.high} m")
        for name in ("speed", "acceleration"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")


class BoundedMotion:
    """A setpoint that follows what is wanted as fast as the bounds allow.

    Args:
        bounds: Of the axis.
        position: Where the axis stands when it is taken over.
        speed: How fast it goes then.

    Attributes:
        position: Setpoint, within the travel.
        speed: Its rate.
        limited: Whether the last step fell short of what was wanted.
    """

    def __init__(self, bounds: AxisBounds, position: float, speed: float) -> None:
        self.bounds = bounds
        self.position = min(max(position, bounds.low), bounds.high)
        self.speed = min(max(speed, -bounds.speed), bounds.speed)
        self.limited = False
        self._low, self._high = bounds.low, bounds.high

    def wait_for(self, position: float, reach: float) -> None:
        """Stop within a reach [m] of where the axis stands, and the way that braking takes.

        An axis that does not follow would otherwise rush to a setpoint far away when it does again.
        """
        bounds = self.bounds
        reach += self.speed**2 / (2.0 * _BRAKING_SHARE * bounds.acceleration)
        self._low = min(max(bounds.low, position - reach), bounds.high)
        self._high = max(min(bounds.high, position + reach), bounds.low)

    def follow(self, position: float, speed: float, dt: float) -> None:
        """Move on by dt [s] towards a wanted position and its rate at the end of the step."""
        wanted = min(max(position, self._low), self._high)
        # The rate at which the step would end exactly where the want will be, but no faster
        # than from where the rest of the way can still be braked.
        gap = wanted - self.position
        carried = speed if wanted == position else 0.0
        exact = gap / dt
        closing = carried + self._closing(gap - carried * dt, dt)
        goal = exact if abs(exact - carried) <= abs(closing - carried) else closing
        reachable = self._change(goal, dt)
        short = abs(reachable - exact) > 1.0e-9 + 1.0e-6 * abs(exact)
        self.limited = short or wanted != position
        self._move(reachable, dt)

    def go(self, speed: float, dt: float) -> None:
        """Move on by dt [s] towards a speed."""
        reachable = self._change(speed, dt)
        self.limited = reachable != speed
        self._move(reachable, dt)

    def _closing(self, gap: float, dt: float) -> float:
        """Return the speed from which a gap is braked within it, a step of dt [s] from now on."""
        braking = _BRAKING_SHARE * self.bounds.acceleration
        step = 0.5 * braking * dt
        return math.copysign(math.sqrt(step**2 + 2.0 * braking * abs(gap)) - step, gap)

    def _change(self, goal: float, dt: float) -> float:
        bounds = self.bounds
        lowest = max(-bounds.speed, self._closing(self._low - self.position, dt))
        highest = min(bounds.speed, self._closing(self._high - self.position, dt))
        goal = min(max(goal, lowest), highest)
        most = bounds.acceleration * dt
        return min(max(goal, self.speed - most), self.speed + most)

    def _move(self, speed: float, dt: float) -> None:
        bounds = self.bounds
        self.position = min(max(self.position + speed * dt, bounds.low), bounds.high)
        self.speed = speed
