"""What of a program cannot be wound: turns over each other, cable beyond the travel.

The lay law and the solver know one layer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lay_control_node.programs.points import FULL_TURN
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.units import MILLIMETRE

# Neighbours are compared every so much of a turn, and at every point of the program.
_STEP = FULL_TURN / 48.0
_ROUNDING = 1.0e-9  # Touching neighbours are no overlap
_MOST_PAIRS = 20_000_000  # No run winds more, and comparing them would take minutes


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """A place where the cable lies across cable that lies there already."""

    theta: float  # Wound angle of the upper one [rad]
    below: float  # Wound angle of the lower one [rad]
    z: float  # Where [m]


def refuse_overlap(program: LayProgram, cable_diameter: float) -> None:
    """Refuse turns that lie along each other closer than the cable is wide.

    Where z has turned back in between and they run in different directions they cross, see
    `crossings`.

    Raises:
        LayProgramError: Two turns would overlap; the message contains where.
    """
    theta = _compared(program)
    slope = program.slope_at(theta)
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(program.z)))])

    def way(at: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far z has gone up and down [m] by wound angles [rad], same shape."""
        return np.asarray(np.interp(at, program.theta, travelled))

    for k in _turns_apart(program, theta):
        later = theta + FULL_TURN * k
        inside = later <= program.end + _ROUNDING
        here, there = theta[inside], later[inside]
        gap = program.z_at(there) - program.z_at(here)
        first, second = slope[inside], program.slope_at(np.minimum(there, program.end))
        # Without a turn back in between they are neighbours, a rest included.
        neighbours = way(there) - way(here) <= np.abs(gap) + _ROUNDING * cable_diameter
        along = neighbours | (np.sign(first) == np.sign(second))
        close = along & (np.abs(gap) < cable_diameter * (1.0 - _ROUNDING))
        if close.any():
            at = int(np.argmax(close))
            raise LayProgramError(
                f"turns would overlap: at {there[at] / FULL_TURN:.2f} turns the cable would lie "
                f"{abs(gap[at]) / MILLIMETRE:.3g} mm beside what lies there since "
                f"{here[at] / FULL_TURN:.2f} turns, less than its diameter of "
                f"{cable_diameter / MILLIMETRE:.3g} mm, and one layer only is supported"
            )


def crossings(program: LayProgram) -> tuple[Crossing, ...]:
    """Return where turns of opposite direction cross, in the order in which they are wound."""
    theta = _compared(program)
    found = []
    for k in _turns_apart(program, theta):
        later = theta + FULL_TURN * k
        inside = later <= program.end
        gap = program.z_at(later[inside]) - program.z_at(theta[inside])
        for at in np.flatnonzero(np.diff(gap > 0.0)):
            share = gap[at] / (gap[at] - gap[at + 1])
            below = float(theta[at] + share * (theta[at + 1] - theta[at]))
            found.append(
                Crossing(theta=below + FULL_TURN * k, below=below, z=float(program.z_at(below)))
            )
    return tuple(sorted(found, key=lambda item: item.theta))


def _turns_apart(program: LayProgram, theta: NDArray[np.float64]) -> range:
    """Return how many turns may lie between two turns that meet."""
    turns = int(program.end / FULL_TURN + _ROUNDING)
    steps = np.diff(program.z)
    if (steps > 0.0).all() or (steps < 0.0).all():
        # Further turns are further away.
        return range(1, min(turns, 1) + 1)
    if turns * theta.size > _MOST_PAIRS:
        raise LayProgramError(
            f"a program with reversals or dwells of {turns} turns and {program.theta.size} points "
            f"is too long to look for turns that overlap: at most {_MOST_PAIRS} pairs are compared"
        )
    return range(1, turns + 1)


def _compared(program: LayProgram) -> NDArray[np.float64]:
    """Return the angles at which turns are compared, ascending, shape (m,)."""
    even = np.arange(0.0, program.end, _STEP)
    before = np.concatenate([(program.theta - FULL_TURN * k) for k in (0, 1)])
    theta = np.union1d(even, before)
    return np.asarray(theta[(theta >= 0.0) & (theta <= program.end)])


def refuse_beyond(program: LayProgram, low: float, high: float) -> None:
    """Refuse a program that wants cable where the guide cannot go.

    Args:
        program: The program.
        low: Start of the carriage's travel [m].
        high: Its end [m].

    Raises:
        LayProgramError: A point lies outside; the message contains which.
    """
    beyond = np.maximum(low - program.z, program.z - high)
    worst = int(np.argmax(beyond))
    if beyond[worst] > 0.0:
        raise LayProgramError(
            f"the program wants the cable at {program.z[worst] / MILLIMETRE:g} mm after "
            f"{program.theta[worst] / FULL_TURN:.3g} turns, the carriage travels from "
            f"{low / MILLIMETRE:g} to {high / MILLIMETRE:g} mm"
        )
