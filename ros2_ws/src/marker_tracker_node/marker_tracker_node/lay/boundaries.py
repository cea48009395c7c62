"""An edge to a part of a pixel: least squares of what the brightness does on both its sides.

Towards its rim the brightness of a round cable falls like the root of the distance; beside the
cable it is even. Where neighbours touch both sides fall. All four numbers of the two sides are
fitted, so neither the sign of the contrast nor the light matters.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called

FloatArray = NDArray[np.float64]

# Steps to either side of an edge that are tried in search of it, and to make it finer.
COARSE_STEPS, FINE_STEPS, WIDE_STEPS = 4, 2, 5
FINE_STEP = 0.35
UNKNOWNS = 4

# Integral of the brightness over the way from the rim, both over half a turn, at equal steps.
SHAPE_SIZE = 1024
_WAY = 1.0 - np.linspace(0.0, 1.0, SHAPE_SIZE + 1)
SHAPE = 0.25 * math.pi - 0.5 * (_WAY * np.sqrt(1.0 - _WAY**2) + np.arcsin(_WAY))


@called
def _shape(way: float, half: float) -> float:  # pragma: no cover
    """Return the integral of the brightness of a round cable over a way from its rim."""
    if way <= 0.0:
        return 0.0
    place = way / half * SHAPE_SIZE
    if place >= SHAPE_SIZE:
        return half * SHAPE[SHAPE_SIZE] + way - half
    k = int(place)
    return half * (SHAPE[k] + (place - k) * (SHAPE[k + 1] - SHAPE[k]))


@called
def _misfit(
    signal: FloatArray,
    first: int,
    last: int,
    edge: float,
    half: float,
    below: bool,
    above: bool,
    normal: FloatArray,
) -> float:  # pragma: no cover
    """Return the sum of squares that is left when the edge stands at a column.

    Args:
        signal: Brightness.
        first: First column that counts.
        last: Last column that counts.
        edge: Column of the edge.
        half: Half the width of a turn [px].
        below: Whether there is cable below the edge.
        above: Whether there is cable above the edge.
        normal: Room, shape (UNKNOWNS, UNKNOWNS + 1).
    """
    normal[:] = 0.0
    squares = 0.0
    for u in range(first, last + 1):
        # Each pixel is a mean over its width, a part of which may lie on either side.
        low, high = u - 0.5, u + 0.5
        share = min(max(high - edge, 0.0), 1.0)
        if above:
            upper = _shape(high - edge, half) - _shape(low - edge, half)
        else:
            upper = share * (max(u - edge, 0.0)) / half
        if below:
            lower = _shape(edge - low, half) - _shape(edge - high, half)
        else:
            lower = (1.0 - share) * (max(edge - u, 0.0)) / half
        a0, a1, a2, a3 = 1.0 - share, lower, share, upper
        y = signal[u]
        squares += y * y
        normal[0, 0] += a0 * a0
        normal[0, 1] += a0 * a1
        normal[0, 2] += a0 * a2
        normal[0, 3] += a0 * a3
        normal[0, 4] += a0 * y
        normal[1, 1] += a1 * a1
        normal[1, 2] += a1 * a2
        normal[1, 3] += a1 * a3
        normal[1, 4] += a1 * y
        normal[2, 2] += a2 * a2
        normal[2, 3] += a2 * a3
        normal[2, 4] += a2 * y
        normal[3, 3] += a3 * a3
        normal[3, 4] += a3 * y
    # Cholesky's way, with the right side as a further row: what is left of the squares.
    for k in range(UNKNOWNS):
        pivot = normal[k, k]
        if pivot < 1.0e-9:
            continue
        for i in range(k + 1, UNKNOWNS):
            factor = normal[k, i] / pivot
            for j in range(i, UNKNOWNS + 1):
                normal[i, j] -= factor * normal[k, j]
        squares -= normal[k, UNKNOWNS] * normal[k, UNKNOWNS] / pivot
    return max(squares, 0.0)


@called
def refined_edge(
    signal: FloatArray,
    edge: float,
    half: float,
    room_below: float,
    room_above: float,
    below: bool,
    above: bool,
    steps: int,
    step: float,
    normal: FloatArray,
) -> tuple[float, float]:  # pragma: no cover
    """Return the place of an edge and its standard deviation, nan where it cannot be told.

    All lengths are groups of columns.

    Args:
        signal: Brightness.
        edge: Where it is sought.
        half: Half the width of a turn.
        room_below: Way below the edge that belongs to one side.
        room_above: The same above.
        below: Whether there is cable below.
        above: Whether there is cable above.
        steps: That are tried to either side.
        step: Their width.
        normal: Room, shape (UNKNOWNS, UNKNOWNS + 1).
    """
    first = max(math.ceil(edge - room_below), 0)
    last = min(math.floor(edge + room_above), signal.size - 1)
    count = last - first + 1
    if count < UNKNOWNS + 2:
        return math.nan, math.nan
    best, low, middle, high = 0, math.nan, math.inf, math.nan
    previous = math.nan
    for k in range(-steps, steps + 1):
        misfit = _misfit(signal, first, last, edge + step * k, half, below, above, normal)
        if misfit < middle:
            best, low, middle, high = k, previous, misfit, math.nan
        elif k == best + 1:
            high = misfit
        previous = misfit
    bend = low - 2.0 * middle + high
    if not bend > 0.0:
        return math.nan, math.nan
    place = edge + step * (best + 0.5 * (low - high) / bend)
    # The sum of squares rises by the variance of a group within one standard deviation.
    variance = (middle + 3.0) / max(count - UNKNOWNS - 1, 1)
    return place, step * math.sqrt(2.0 * variance / bend)
