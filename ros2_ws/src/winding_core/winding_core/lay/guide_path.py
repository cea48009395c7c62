"""The law of the lag: where the guide must stand for a lay, and where a sticking cable lands."""

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.lay.smoothed_line import SmoothedLine
from winding_core.units import MILLIMETRE

Array = NDArray[np.float64]

# The first and the last piece are looked at so far before and behind the corners [rad].
_BEYOND = 1.0e3


def layer_lag(lag: float, radius: float, raised: Array) -> Array:
    """Return the lag of cable that lies on cable [rad], same shape as `raised`.

    The guide keeps its distance from the axis, so the span shortens as its radius grows.

    Args:
        lag: On the bare cylinder [rad], free length over radius.
        radius: Of the centre line there [m].
        raised: Height of the centre line above that [m], any shape.

    Raises:
        LayProgramError: The cable would reach the guide.
    """
    outer = radius + raised
    distance = radius * float(np.hypot(lag, 1.0))
    if (outer >= distance).any():
        raise LayProgramError(
            f"cable that lies {outer.max() / MILLIMETRE:.4g} mm off the axis would reach the "
            f"guide, which is {distance / MILLIMETRE:.4g} mm off"
        )
    return np.asarray(np.sqrt((distance - outer) * (distance + outer)) / outer)


def lags_of(program: LayProgram, what: ResolvedCondition) -> Array:
    """Return the lag of each piece of a program by its layer's radius [rad], shape (points - 1,).

    Raises:
        LayProgramError: The cable would reach the guide.
    """
    rho = what.case.centreline_radius
    return layer_lag(what.free_length / rho, rho, program.raised[:-1])


def guide_path(program: LayProgram, lag: float | Array, width: float) -> SmoothedLine:
    """Return g = z + lag dz/dtheta of a program's rounded z.

    Cable lands by dz/dtheta = (g - z) / lag; a corner of z is a step of g.

    Args:
        program: What is wanted.
        lag: Free length over centreline radius [rad], one or shape (points - 1,).
        width: Of the kernel [rad].
    """
    slopes = np.diff(program.z) / np.diff(program.theta)
    ahead = lag * slopes
    bends, steps = np.diff(slopes), np.diff(ahead)
    kept = (bends != 0.0) | (steps != 0.0)
    return SmoothedLine(
        theta=program.theta[1:-1][kept],
        bends=bends[kept],
        steps=steps[kept],
        value=float(program.z[0] + ahead[0]),
        slope=float(slopes[0]),
        width=width,
    )


def within(line: SmoothedLine, low: float, high: float) -> SmoothedLine:
    """Return a path that stays on its way but within the carriage's travel [m].

    What is rounded never leaves the range of the straight pieces.

    Args:
        line: The path.
        low: Start of the travel [m].
        high: Its end [m].
    """
    first = float(line.theta[0]) if line.theta.size else 0.0
    last = float(line.theta[-1]) if line.theta.size else 0.0
    ends = np.concatenate([[min(first, 0.0) - _BEYOND], line.theta, [last + _BEYOND]])
    starts, values, slopes = [], [], []
    for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        at_a = float(line.unrounded(np.array([a]))[0])
        slope = float(line.unrounded(np.array([a]), 1)[0])
        cuts = [a]
        if slope != 0.0:
            crossed = sorted(a + (limit - at_a) / slope for limit in (low, high))
            cuts += [cut for cut in crossed if a < cut < b]
        for start, end in zip(cuts, [*cuts[1:], b], strict=True):
            middle = at_a + slope * (0.5 * (start + end) - a)
            inside = low < middle < high
            starts.append(start)
            values.append(min(max(at_a + slope * (start - a), low), high))
            slopes.append(slope if inside else 0.0)
    theta, value, slope_of = np.array(starts), np.array(values), np.array(slopes)
    arriving = value[:-1] + slope_of[:-1] * np.diff(theta)
    return SmoothedLine(
        theta=theta[1:],
        bends=np.diff(slope_of),
        steps=value[1:] - arriving,
        value=float(value[0] - slope_of[0] * theta[0]),
        slope=float(slope_of[0]),
        width=line.width,
    )


_SHORT = 1.0e-4  # Below this share of the lag the integrals take their series


def lay_of(theta: Array, guide: Array, lag: float | Array, start: float = 0.0) -> Array:
    """Return z of the laid cable [m], shape (n,), exact for a guide that goes straight in between.

    Args:
        theta: Wound angles, not descending [rad], shape (n,).
        guide: Of the guide there [m], shape (n,).
        lag: Free length over centreline radius [rad], one or shape (n - 1,).
        start: z at the first angle [m].
    """
    x = np.diff(theta) / lag
    decay = np.exp(-x)
    gone = -np.expm1(-x)
    safe = np.where(x > _SHORT, x, 1.0)
    ramp = np.where(x > _SHORT, 1.0 - gone / safe, x / 2.0 - x**2 / 6.0)
    driven = guide[:-1] * gone + np.diff(guide) * ramp
    z, laid = start, [start]
    for kept, added in zip(decay.tolist(), driven.tolist(), strict=True):
        z = kept * z + added
        laid.append(z)
    return np.array(laid)


_SAMPLES = 20_001  # Places of a drive programme's motion at which its lay is looked at


def lay_of_drive(what: ResolvedCondition) -> tuple[Array, Array]:
    """Return wound angles [rad] and z [m] of what a condition's drive programme lays."""
    theta, guide = what.drive.positions(np.linspace(0.0, what.duration, _SAMPLES))
    return theta, lay_of(theta, guide, what.free_length / what.case.centreline_radius)
