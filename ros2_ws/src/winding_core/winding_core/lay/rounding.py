"""How widely a path's corners must be rounded for the carriage to follow, and by how much."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.condition import ResolvedCondition
from winding_core.helix import FloatOrArray, like
from winding_core.lay.guide_path import guide_path, lags_of, within
from winding_core.lay.limits import PlanLimits
from winding_core.lay.program import LayProgram
from winding_core.lay.smoothed_line import REACH, SmoothedLine, smoothed_program
from winding_core.machine.drive import DriveProfile

Array = NDArray[np.float64]

WIDEST = 0.5 * np.pi  # A quarter of a turn: beyond that the cylinder had better turn slower
# For friction corners are rounded up to so much [rad], and to so much of what it holds.
WIDEST_BY_FRICTION = 2.5
OF_FRICTION = 1.2
# Corners are rounded at least so much [rad]: that is 0.1 mm at a reversal of a pitch of 18 mm.
NARROWEST = 0.1
# Samples of a path in a kernel's width, and the share of a limit that is used, so that what lies
# between them keeps it too.
SAMPLES = 32
USED = 0.97
_SEARCHES = 14
_NAMES = ("speed", "acceleration", "jerk")


def demands(line: SmoothedLine, speed: float, limits: PlanLimits) -> dict[str, float]:
    """Return the largest speed, acceleration and jerk of the guide as shares of their limits."""
    theta = _samples(line)
    most = (limits.carriage_speed, limits.carriage_acceleration, limits.carriage_jerk)
    return {
        name: float(np.abs(line.at(theta, order)).max()) * speed**order / limit
        for order, name, limit in zip((1, 2, 3), _NAMES, most, strict=True)
    }


def needed_width(line: SmoothedLine, speed: float, limits: PlanLimits) -> float:
    """Return the smallest width [rad] at which the carriage follows, or WIDEST if none does.

    Args:
        line: The guide's path; its own width does not matter.
        speed: Of the cylinder, constant [rad/s].
        limits: Of the machine.
    """

    def kept(width: float) -> bool:
        return max(demands(replace(line, width=width), speed, limits).values()) <= USED

    return _smallest(kept)


def width_within(line: SmoothedLine, most: float, widest: float) -> float:
    """Return the largest width [rad] up to the widest that rounds no corner by more than `most`.

    Args:
        line: The wanted z over the wound angle.
        most: Largest rounding [m].
        widest: Upper end of the search [rad].
    """
    if not line.theta.size:
        return widest
    width = widest
    while width > NARROWEST:
        rounded = float(np.abs(replace(line, width=width).rounded_by()).max())
        if rounded <= most:
            break
        # The rounding grows with the width: a little too small is on the safe side.
        width *= max(0.5, min(0.98, most / rounded))
    return max(width, NARROWEST)


def width_without_slip(line: SmoothedLine, radius: float, friction: float) -> float:
    """Return the smallest width [rad] at which friction holds the path, or 0 if none does.

    Cable on a cylinder holds a path of geodesic curvature z''/rho^2 against the pressure of its own
    curvature 1/rho with a friction of z''/rho. A little more than friction holds is taken: the rod
    slips so little by it that further rounding would cost more.

    Args:
        line: The wanted z over the wound angle.
        radius: rho, of the wound cable's centreline [m].
        friction: Of cable on cylinder, dimensionless.
    """
    if not line.theta.size:
        return 0.0

    def kept(width: float) -> bool:
        rounded = replace(line, width=width)
        sharpest = float(np.abs(rounded.at(_samples(rounded), 2)).max())
        return sharpest <= OF_FRICTION * friction * radius

    width = _smallest(kept, WIDEST_BY_FRICTION)
    return width if kept(width) else 0.0


def rounded_for(program: LayProgram, what: ResolvedCondition, limits: PlanLimits) -> SmoothedLine:
    """Return the wanted z of a program, rounded for a condition's speed and friction and limits.

    Raises:
        LayProgramError: Layers would reach the guide.
    """
    rho = what.case.centreline_radius
    path = within(guide_path(program, lags_of(program, what), 0.0), *limits.travel)
    width = needed_width(path, what.drive.angular_speed, limits)
    line = smoothed_program(program, width)
    return replace(line, width=max(width, width_without_slip(line, rho, what.friction)))


def _smallest(kept: Callable[[float], bool], widest: float = WIDEST) -> float:
    low, high = NARROWEST, widest
    if kept(low):
        return low
    if not kept(high):
        return high
    for _ in range(_SEARCHES):
        middle = (low * high) ** 0.5
        if kept(middle):
            high = middle
        else:
            low = middle
    return high


def _samples(line: SmoothedLine) -> Array:
    """Return angles in the reach of corners, where alone a path changes, and one beside each."""
    if not line.theta.size:
        return np.zeros(1)
    step = line.width / SAMPLES
    around = np.arange(-REACH * SAMPLES - 1.0, REACH * SAMPLES + 2.0)
    if line.theta.size * around.size > 2_000_000:
        return np.arange(line.theta[0] - 2.0 * line.width, line.theta[-1] + 2.0 * line.width, step)
    marks = np.rint(line.theta[:, None] / step) + around
    return np.concatenate([np.unique(marks) * step, line.theta])


LEAST_REPORTED = 1.0e-5  # Smaller roundings are not reported [m]


@dataclass(frozen=True, kw_only=True)
class Corner:
    """A corner of a program, or several that run into each other."""

    theta: float  # Wound angle of the most rounded one [rad]
    rounding: float  # By which it is rounded [m], towards the inside of the corner
    rounding_at_half_speed: float  # With the cylinder at half the speed [m]


def corners(line: SmoothedLine, at_half_speed: SmoothedLine) -> tuple[Corner, ...]:
    """Return the corners that are rounded by more than `LEAST_REPORTED`.

    Args:
        line: The wanted z, rounded as it is planned.
        at_half_speed: The same, rounded as at half the cylinder's speed.
    """
    rounded, half = line.rounded_by(), at_half_speed.rounded_by()
    size = np.abs(rounded)
    found = []
    for k in np.flatnonzero(size > LEAST_REPORTED).tolist():
        reach = REACH * line.width
        first = int(np.searchsorted(line.theta, line.theta[k] - reach))
        last = int(np.searchsorted(line.theta, line.theta[k] + reach, side="right"))
        # The first of several that are equal stands for all.
        if first + int(np.argmax(size[first:last])) == k:
            found.append(
                Corner(
                    theta=float(line.theta[k]),
                    rounding=float(rounded[k]),
                    rounding_at_half_speed=float(half[k]),
                )
            )
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class GuidedDrive(DriveProfile):
    """The cylinder of a drive programme, and a guide that goes along a path over its angle."""

    path: SmoothedLine

    @classmethod
    def along(cls, program: LayProgram, what: ResolvedCondition, limits: PlanLimits) -> Self:
        """Return the motion that lays a program; the guide begins at P0 and then takes its lead.

        Raises:
            LayProgramError: Layers would reach the guide.
        """
        width = rounded_for(program, what, limits).width
        path = within(guide_path(program, lags_of(program, what), 0.0), *limits.travel)
        lead, begun = float(path.at(0.0)), REACH * width
        place = int(np.searchsorted(path.theta, begun))
        path = replace(
            path,
            theta=np.insert(path.theta, place, begun),
            bends=np.insert(path.bends, place, 0.0),
            steps=np.insert(path.steps, place, lead),
            value=path.value - lead,
            width=width,
        )
        drive = what.drive
        return cls(
            angular_speed=drive.angular_speed,
            feed_speed=drive.feed_speed,
            ramp_time=drive.ramp_time,
            path=path,
        )

    def speeds(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """See `DriveProfile.speeds`."""
        angle, (speed, _) = super().positions(t)[0], super().speeds(t)
        return speed, like(t, speed * self.path.at(angle, 1))

    def positions(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """See `DriveProfile.positions`."""
        angle = super().positions(t)[0]
        return angle, like(t, self.path.at(angle))
