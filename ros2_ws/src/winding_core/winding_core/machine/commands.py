"""What an outside commander asks of the machine: targets, a trajectory, a tension."""

import bisect
from collections.abc import Mapping
from dataclasses import dataclass

CYLINDER, CARRIAGE = "cylinder", "carriage"
AXES = {CYLINDER: "rad", CARRIAGE: "m"}  # Axis -> unit of its way


@dataclass(frozen=True, kw_only=True)
class AxisTarget:
    """Where an axis shall be, or how fast it shall go."""

    position: float | None = None  # [rad or m]; None to command the speed alone.
    speed: float | None = None  # [rad/s or m/s]; beside a position, the speed at which that changes

    @property
    def moves_to(self) -> bool:
        """Whether a position is commanded."""
        return self.position is not None

    @property
    def number(self) -> float:
        """The position [rad or m], or the speed where that alone is commanded."""
        return (self.speed or 0.0) if self.position is None else self.position


@dataclass(frozen=True, kw_only=True)
class JointTargets:
    """Targets of one or both axes, as a stream of them or one that changed."""

    t: float  # When they hold [s]; 0 for now.
    axes: Mapping[str, AxisTarget]  # By name of the axis.


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Position [rad or m] and speed [rad/s or m/s] of an axis; position None where any will do."""

    position: float | None
    speed: float


@dataclass(frozen=True, kw_only=True)
class Waypoint:
    """A point of a trajectory."""

    t: float  # Time, from the trajectory's start or absolute [s].
    position: float  # [rad or m]
    speed: float | None = None  # [rad/s or m/s]; None where positions alone are given.


@dataclass(frozen=True, kw_only=True)
class JointTrajectory:
    """A trajectory of one or both axes; axes without waypoints hold."""

    t: float  # When it begins [s]; 0 for now.
    axes: Mapping[str, tuple[Waypoint, ...]]  # Waypoints from its start by name of the axis.


@dataclass(frozen=True, kw_only=True)
class TensionCommand:
    """Pull of the brake on the cable: `t` [s] and `force` [N]."""

    t: float
    force: float


Command = JointTargets | JointTrajectory | TensionCommand


class Interpolation:
    """Interpolates waypoints as joint_trajectory_controller does.

    Between two points with speeds it is a cubic (Hermite) polynomial, else a straight line.

    Args:
        points: Two or more, at ascending times.
    """

    def __init__(self, points: tuple[Waypoint, ...]) -> None:
        self.points = points
        self._times = [point.t for point in points]

    def at(self, t: float) -> Motion:
        """Return the motion at time t [s]; before the first and after the last point it stands."""
        if t >= self._times[-1]:
            return Motion(position=self.points[-1].position, speed=0.0)
        if t < self._times[0]:
            return Motion(position=self.points[0].position, speed=0.0)
        k = bisect.bisect_right(self._times, t)
        first, last = self.points[k - 1], self.points[k]
        span, way = last.t - first.t, last.position - first.position
        x = (t - first.t) / span
        if first.speed is None or last.speed is None:
            return Motion(position=first.position + way * x, speed=way / span)
        a, b = _cubic(first.speed * span, last.speed * span, way)
        return Motion(
            position=first.position + x * (first.speed * span + x * (a + x * b)),
            speed=first.speed + x * (2.0 * a + 3.0 * b * x) / span,
        )

    def fastest(self) -> tuple[float, float]:
        """Return the largest speed [rad/s or m/s] and the time of it [s]."""
        found = []
        for first, last in zip(self.points, self.points[1:], strict=False):
            span, way = last.t - first.t, last.position - first.position
            if first.speed is None or last.speed is None:
                found.append((abs(way / span), first.t))
                continue
            a, b = _cubic(first.speed * span, last.speed * span, way)
            found += [(abs(first.speed), first.t), (abs(last.speed), last.t)]
            top = -a / (3.0 * b) if b else 0.0
            if 0.0 < top < 1.0:
                found.append((abs(first.speed + top * a / span), first.t + top * span))
        return max(found)

    def hardest(self) -> tuple[float, float]:
        """Return the largest acceleration within cubics [per s^2] and the time of it [s]."""
        found = [(0.0, self._times[0])]
        for first, last in zip(self.points, self.points[1:], strict=False):
            if first.speed is not None and last.speed is not None:
                span = last.t - first.t
                a, b = _cubic(first.speed * span, last.speed * span, last.position - first.position)
                found.append((abs(2.0 * a) / span**2, first.t))
                found.append((abs(2.0 * a + 6.0 * b) / span**2, last.t))
        return max(found)

    def reach(self) -> tuple[float, float]:
        """Return the smallest and the largest position [rad or m], overshoot of cubics included."""
        found = [point.position for point in self.points]
        for first, last in zip(self.points, self.points[1:], strict=False):
            if first.speed is not None and last.speed is not None:
                span, way = last.t - first.t, last.position - first.position
                start = first.speed * span
                a, b = _cubic(start, last.speed * span, way)
                found += [
                    first.position + x * (start + x * (a + x * b))
                    for x in _roots(3.0 * b, 2.0 * a, start)
                    if 0.0 < x < 1.0
                ]
        return min(found), max(found)


def _cubic(start: float, end: float, way: float) -> tuple[float, float]:
    """Return a, b of start x + a x^2 + b x^3 on 0..1, which ends at `way` with slope `end`."""
    return 3.0 * way - 2.0 * start - end, start + end - 2.0 * way


def _roots(a: float, b: float, c: float) -> tuple[float, ...]:
    """Return the real roots of a x^2 + b x + c."""
    if a == 0.0:
        return (-c / b,) if b else ()
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return ()
    return ((-b - square**0.5) / (2.0 * a), (-b + square**0.5) / (2.0 * a))
