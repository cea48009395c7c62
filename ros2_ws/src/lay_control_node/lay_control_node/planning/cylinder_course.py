"""The cylinder's way over time: a smooth ramp, a steady speed, a smooth ramp to a stop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Largest slope of the smooth ramp, over that of a straight one.
STEEPEST = 1.5


@dataclass(frozen=True, kw_only=True)
class CylinderCourse:
    """Angle of the cylinder over time, from rest to rest.

    Attributes:
        angle: Angle of the whole way [rad].
        speed: Between the ramps [rad/s].
        ramp: Time of a ramp [s].
        wait: Time before it begins [s].
    """

    angle: float
    speed: float
    ramp: float
    wait: float = 0.0

    @classmethod
    def over(cls, angle: float, speed: float, ramp: float, acceleration: float) -> CylinderCourse:
        """Return the course over an angle [rad] that keeps an acceleration [rad/s^2].

        Args:
            angle: Of the whole way [rad]; a short one never reaches the speed.
            speed: At most [rad/s].
            ramp: At least [s].
            acceleration: At most [rad/s^2].
        """
        ramp = max(ramp, STEEPEST * speed / acceleration)
        return cls(angle=angle, speed=min(speed, angle / ramp), ramp=ramp)

    @property
    def end(self) -> float:
        """When it has come to rest [s]."""
        return self.wait + self.angle / self.speed + self.ramp

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Return the angle [rad] and its derivatives to the third at times [s], shape (m,) each."""
        begun, ending = t - self.wait, self.end - t
        up, down = begun <= ending, begun > ending
        near = np.where(up, begun, ending)
        x = np.clip(near / self.ramp, 0.0, 1.0)
        way = self.speed * (self.ramp * (x**3 - 0.5 * x**4) + np.maximum(near - self.ramp, 0.0))
        sign = np.where(down, -1.0, 1.0)
        changing = (near > 0.0) & (near < self.ramp)
        return (
            np.where(up, way, self.angle - way),
            self.speed * (3.0 * x**2 - 2.0 * x**3),
            sign * self.speed / self.ramp * np.where(changing, 6.0 * x * (1.0 - x), 0.0),
            self.speed / self.ramp**2 * np.where(changing, 6.0 - 12.0 * x, 0.0),
        )
