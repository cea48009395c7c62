"""By how much a program's corners are rounded, and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lay_control_node.planning.smoothed_line import REACH, SmoothedLine

# Smaller roundings are not told [m].
LEAST_TOLD = 1.0e-5


@dataclass(frozen=True, kw_only=True)
class Corner:
    """A corner of a program, or several that run into each other.

    Attributes:
        theta: Wound angle of the most rounded one [rad].
        rounding: By which it is rounded [m], towards the inside of the corner.
        rounding_at_half_speed: With the cylinder at half the speed [m].
    """

    theta: float
    rounding: float
    rounding_at_half_speed: float


def corners(line: SmoothedLine, at_half_speed: SmoothedLine) -> tuple[Corner, ...]:
    """Return the corners that are rounded by anything worth telling.

    Args:
        line: The wanted z, rounded as it is planned.
        at_half_speed: The same, rounded as at half the cylinder's speed.
    """
    rounded, half = line.rounded_by(), at_half_speed.rounded_by()
    size = np.abs(rounded)
    found = []
    for k in np.flatnonzero(size > LEAST_TOLD).tolist():
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
