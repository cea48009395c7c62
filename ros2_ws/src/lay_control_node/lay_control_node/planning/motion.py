"""The machine's motion along a guide's path: both axes over time, within every limit."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.cylinder_course import CylinderCourse
from lay_control_node.planning.kernel_width import SAMPLES, USED
from lay_control_node.planning.limits import PlanLimits
from lay_control_node.planning.slowing import Slowing, TooFastError, slowed
from lay_control_node.planning.smoothed_line import SmoothedLine

Array = NDArray[np.float64]

# Longest step of the motion's own time [s]; a ramp of 50 ms has ten of them.
_STEP = 5.0e-3
# Time over which the speed changes where the cylinder is slowed [s].
_SLOWING_TIME = 0.1
MOST_SAMPLES = 2_000_000
_HALVINGS = 8
_MUCH_SLOWED = 0.3
# Largest speed, acceleration and jerk of 10 x^3 - 15 x^4 + 6 x^5 over 0..1.
_PEAKS = (1.875, 10.0 / math.sqrt(3.0), 60.0)


class UnreachableError(ValueError):
    """No motion keeps the limits, or it is too long to be planned."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Both axes over time, from rest to rest.

    Attributes:
        path: Of the guide over the wound angle [m].
        course: Of the cylinder over the motion's own time.
        approach: Time in which the guide takes its place ahead of the cable [s].
        slowing: The motion's own time over real time.
    """

    path: SmoothedLine
    course: CylinderCourse
    approach: float
    slowing: Slowing

    @property
    def end(self) -> float:
        """When both axes have come to rest [s]."""
        return self.slowing.end

    @property
    def lost(self) -> float:
        """Time that slowing costs [s]."""
        return self.end - self.slowing.step * (self.slowing.shares.size - 1)

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Return cylinder angle [rad], its speed [rad/s], guide [m], its speed [m/s] at times [s].

        Args:
            t: Shape (m,); before the start and after the end the machine stands.
        """
        own = self.slowing.own_time(t)
        going = self.slowing.share(own) * ((t > 0.0) & (t < self.end))
        theta, omega, *_ = self.course.at(own)
        guide, feed, *_ = _guide(self.path, self.course, self.approach, own)
        return theta, omega * going, guide, feed * going

    def grid(self) -> tuple[Array, Array, Array]:
        """Return real time [s], angle [rad] and guide [m] at every sample, shape (n,) each."""
        own: Array = self.slowing.step * np.arange(self.slowing.shares.size, dtype=float)
        guide = _guide(self.path, self.course, self.approach, own)[0]
        return self.slowing.real_time(own), self.course.at(own)[0], guide


def motion_along(
    path: SmoothedLine,
    angle: float,
    speed: float,
    ramp: float,
    limits: PlanLimits,
    *,
    together: bool,
) -> Motion:
    """Return the motion along a path, slower than the speed only where a limit asks for it.

    Args:
        path: Of the guide [m] over the wound angle [rad].
        angle: At which the cylinder stops [rad].
        speed: Of the cylinder, at most [rad/s].
        ramp: Time in which it comes to speed, at least [s].
        limits: Of the machine.
        together: Whether the guide takes its place ahead of the cable while the cylinder ramps,
            or before it turns.

    Raises:
        UnreachableError: No speed keeps the limits, or the motion is too long to be planned.
    """
    best: Motion | None = None
    for _ in range(_HALVINGS):
        try:
            found = _motion(path, angle, speed, ramp, limits, together=together)
        except TooFastError:
            found = None
        if best is not None and (found is None or found.end >= best.end):
            return best
        if found is not None and found.slowing.shares.min() > _MUCH_SLOWED:
            return found
        # What has to be slowed by much is often sooner done at an even, lower speed.
        best, speed = found, 0.5 * speed
    if best is None:
        raise UnreachableError(
            f"the carriage cannot follow within its limits even at {speed:.3g} rad/s"
        )
    return best


def _motion(
    path: SmoothedLine,
    angle: float,
    speed: float,
    ramp: float,
    limits: PlanLimits,
    *,
    together: bool,
) -> Motion:
    course = CylinderCourse.over(angle, speed, ramp, limits.cylinder_acceleration * USED)
    approach = _approach_time(abs(float(path.at(0.0))), limits)
    if not together:
        course = replace(course, wait=approach)
    step = min(_STEP, course.ramp / SAMPLES)
    if path.theta.size:
        step = min(step, path.width / (SAMPLES * course.speed))
    # A short program may be wound before the guide has taken its place.
    end = max(course.end, approach)
    count = math.ceil(end / step)
    if count > MOST_SAMPLES:
        raise UnreachableError(
            f"the motion takes {end:.4g} s in steps of {1e3 * step:.3g} ms: "
            f"{count} samples, more than {MOST_SAMPLES}"
        )
    step = end / count
    own: Array = np.linspace(0.0, end, count + 1)
    cylinder = course.at(own)[1:3]
    guide = _guide(path, course, approach, own)[1:]
    most = USED * np.array(
        [
            limits.cylinder_speed,
            limits.cylinder_acceleration,
            limits.carriage_speed,
            limits.carriage_acceleration,
            limits.carriage_jerk,
        ]
    )
    reach = math.ceil(_SLOWING_TIME / step)
    slowing = slowed((cylinder, guide), most, step, reach)
    return Motion(path=path, course=course, approach=approach, slowing=slowing)


def _approach_time(way: float, limits: PlanLimits) -> float:
    """Return the shortest time [s] for a way [m] from rest to rest."""
    most = (limits.carriage_speed, limits.carriage_acceleration, limits.carriage_jerk)
    times = [
        (peak * way / (USED * limit)) ** (1.0 / order)
        for order, (peak, limit) in enumerate(zip(_PEAKS, most, strict=True), start=1)
    ]
    return float(max(times)) + 1.0e-3


def _guide(
    path: SmoothedLine, course: CylinderCourse, approach: float, own: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the guide [m] and its derivatives to the third over the motion's own time [s]."""
    theta, d1, d2, d3 = course.at(own)
    g, g1, g2, g3 = (path.at(theta, order) for order in range(4))
    missing = float(path.at(0.0))
    x = np.clip(own / approach, 0.0, 1.0)
    inside = x < 1.0
    left = missing * (1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x**2))
    gone = -missing * inside
    return (
        g - left,
        g1 * d1 - gone / approach * 30.0 * x**2 * (1.0 - x) ** 2,
        g2 * d1**2 + g1 * d2 - gone / approach**2 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
        g3 * d1**3
        + 3.0 * g2 * d1 * d2
        + g1 * d3
        - gone / approach**3 * (60.0 - 360.0 * x + 360.0 * x**2),
    )
