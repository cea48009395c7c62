"""The machine's motion along a guide's path: both axes over time, slowed to keep every limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.limits import PlanLimits
from winding_core.lay.rounding import SAMPLES, USED
from winding_core.lay.smoothed_line import SmoothedLine

Array = NDArray[np.float64]

_ROUNDS = 60
_LEAST = 1.0e-3  # A motion that has to be slower than this share of its speed is planned anew
# Nodes and weights of Gauss and Legendre's rule on 0..1, exact to the fifth power.
_NODES = 0.5 + 0.5 * np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


class TooFastError(ValueError):
    """A motion must be slowed by more than can be found from its own time."""


@dataclass(frozen=True, kw_only=True)
class Slowing:
    """Share of the speed at which a motion is run through, over the motion's own time.

    A cubic B-spline: smooth to the second derivative, and never outside its coefficients.
    """

    step: float  # Spacing of the coefficients [s] of the motion's own time
    shares: Array  # Coefficients, shape (n,); share of the speed
    asked: Array  # The same if no limit of the machine slowed it, shape (n,)
    _times: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        inside = np.arange(self.shares.size - 1)
        slow = sum(
            weight / self.share((inside + node) * self.step)
            for node, weight in zip(_NODES, _WEIGHTS, strict=True)
        )
        times = np.concatenate([[0.0], np.cumsum(self.step * np.asarray(slow))])
        object.__setattr__(self, "_times", times)

    @property
    def end(self) -> float:
        """Real time at the last coefficient [s]."""
        return float(self._times[-1])

    @property
    def slowest(self) -> float:
        """Smallest share of the speed that was asked for, at which it is run through."""
        return float((self.shares / self.asked).min())

    def share(self, own: Array) -> Array:
        """Return the share of the speed at the motion's own times [s], same shape."""
        last = self.shares.size - 1
        at = np.clip(own / self.step, 0.0, float(last))
        k = np.minimum(at.astype(int), max(last - 1, 0))
        u = at - k
        c = [self.shares[np.clip(k + shift, 0, last)] for shift in (-1, 0, 1, 2)]
        weights = (
            (1.0 - u) ** 3 / 6.0,
            (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0,
            (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0,
            u**3 / 6.0,
        )
        return np.asarray(sum(w * value for w, value in zip(weights, c, strict=True)))

    def real_time(self, own: Array) -> Array:
        """Return the real time [s] at the motion's own times [s], shape (m,)."""
        k = np.clip((own / self.step).astype(int), 0, self.shares.size - 2)
        rest = own - k * self.step
        more = sum(
            weight * rest / self.share(k * self.step + node * rest)
            for node, weight in zip(_NODES, _WEIGHTS, strict=True)
        )
        return np.asarray(self._times[k] + more)

    def own_time(self, real: Array) -> Array:
        """Return the motion's own time [s] at real times [s], shape (m,)."""
        own = np.interp(real, self._times, self.step * np.arange(self.shares.size))
        real = np.clip(real, 0.0, self.end)
        # Newton; the start is off by what a share changes within a step.
        for _ in range(4):
            own = own + (real - self.real_time(own)) * self.share(own)
            own = np.clip(own, 0.0, self.step * (self.shares.size - 1))
        return np.asarray(own)


def slowed(
    rates: tuple[tuple[Array, ...], ...], most: Array, step: float, reach: int, cap: Array
) -> Slowing:
    """Return how a motion must be slowed so that every rate keeps its limit.

    Args:
        rates: Of each axis: first, second, and where limited third derivative over the motion's
            own time, shape (n,) each.
        most: Their limits in the same order, flat, shape (count of rates,).
        step: Of the motion's own time from sample to sample [s].
        reach: Samples over which the speed may change to either side.
        cap: Largest share of the speed that is asked for, shape (n,).

    Raises:
        TooFastError: A limit is not kept at a thousandth of the speed.
    """
    wanted = _smooth_below(cap, reach)
    for _ in range(_ROUNDS):
        shares = _smooth_below(cap, reach)
        asked = _asked(rates, most, _derivatives(shares, step))
        if (asked <= 1.0).all():
            return Slowing(step=step, shares=shares, asked=wanted)
        cap = np.maximum(np.minimum(cap, shares / np.maximum(asked, 1.0) ** 1.02), 0.0)
        if cap.min() < _LEAST:
            break
    raise TooFastError("the motion is too fast to be slowed")


def _asked(rates: tuple[tuple[Array, ...], ...], most: Array, share: tuple[Array, ...]) -> Array:
    """Return by which factor the speed is too high everywhere, shape (n,)."""
    s, ds, dds = share
    asked = np.zeros(s.size)
    limits = iter(most.tolist())
    for axis in rates:
        first, second = axis[0], axis[1]
        actual = [first * s, second * s**2 + first * s * ds]
        if len(axis) > 2:
            actual.append(
                axis[2] * s**3 + 3.0 * second * s**2 * ds + first * (s * ds**2 + s**2 * dds)
            )
        for order, value in enumerate(actual, start=1):
            asked = np.maximum(asked, (np.abs(value) / next(limits)) ** (1.0 / order))
    return asked


def _derivatives(c: Array, step: float) -> tuple[Array, Array, Array]:
    padded = np.pad(c, 1, mode="edge")
    before, here, after = padded[:-2], padded[1:-1], padded[2:]
    return (
        (before + 4.0 * here + after) / 6.0,
        (after - before) / (2.0 * step),
        (after - 2.0 * here + before) / step**2,
    )


def _smooth_below(cap: Array, reach: int) -> Array:
    """Return the cap smoothed by a cubic kernel, nowhere above it, shape (n,)."""
    if (cap >= 1.0).all():
        return cap
    from scipy.ndimage import minimum_filter1d  # noqa: PLC0415

    box = max(1, reach // 2)
    low: Array = minimum_filter1d(cap, 2 * (2 * box + 1) + 1, mode="nearest")
    for _ in range(4):
        sums = np.cumsum(np.pad(low, (box // 2 + 1, box - 1 - box // 2), mode="edge"))
        low = np.minimum((sums[box:] - sums[:-box]) / box, 1.0)
    return np.asarray(np.maximum(low, 0.1 * _LEAST))


STEEPEST = 1.5  # Largest slope of the smooth ramp, over that of a straight one


@dataclass(frozen=True, kw_only=True)
class CylinderCourse:
    """Angle of the cylinder over time, from rest to rest."""

    angle: float  # Angle of the whole way [rad]
    speed: float  # Between the ramps [rad/s]
    ramp: float  # Time of a ramp [s]
    wait: float = 0.0  # Time before it begins [s]

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


_STEP = 5.0e-3  # Longest step of the motion's own time [s]; a ramp of 50 ms has ten of them
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
    """Both axes over time, from rest to rest."""

    path: SmoothedLine  # Of the guide over the wound angle [m]
    course: CylinderCourse  # Of the cylinder over the motion's own time
    approach: float  # Time in which the guide takes its place ahead of the cable [s]
    slowing: Slowing  # The motion's own time over real time

    @property
    def end(self) -> float:
        """When both axes have come to rest [s]."""
        return self.slowing.end

    @property
    def lost(self) -> float:
        """Time that slowing costs [s]."""
        return self.end - replace(self.slowing, shares=self.slowing.asked).end

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
    share: Callable[[Array], Array] = np.ones_like,
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
        share: Of the speed that is asked for at wound angles [rad], same shape.

    Raises:
        UnreachableError: No speed keeps the limits, or the motion is too long to be planned.
    """
    best: Motion | None = None
    for _ in range(_HALVINGS):
        try:
            found = _motion(path, angle, speed, ramp, limits, together, share)
        except TooFastError:
            found = None
        if best is not None and (found is None or found.end >= best.end):
            return best
        if found is not None and found.slowing.slowest > _MUCH_SLOWED:
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
    together: bool,
    share: Callable[[Array], Array],
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
    theta, *cylinder = course.at(own)[:3]
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
    slowing = slowed((tuple(cylinder), guide), most, step, reach, share(theta))
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
