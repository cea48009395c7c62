"""Edges of a row: places where its brightness steps or has a crease, to a part of a pixel.

Neither the sign of the contrast nor the light matters. Towards its rim the brightness of a round
cable falls like the root of the distance; beside the cable it is even. Where neighbours touch both
sides fall. A least-squares fit of all four numbers of the two sides places an edge.
"""

import math

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# Share of the row's plainest contrast at which an edge counts half, and its limits relative to the
# brightness: beyond the grooves of turned metal, and beyond noise.
HALF_SHARE, HALF_LEAST, HALF_MOST = 0.6, 0.04, 0.2
CREASE_GAIN = 2.5  # A crease of depth c is as plain as a step of this many times c
LEAST_STRENGTH = 0.1  # What is less plain is noise
# Steps to either side of an edge that are tried in search of it, and to make it finer.
COARSE_STEPS, FINE_STEPS, WIDE_STEPS = 4, 2, 5
FINE_STEP = 0.35
UNKNOWNS = 4
LEAST_PIVOT = 1.0e-9
# Integral of the brightness over the way from the rim, both over half a turn, at equal steps.
SHAPE_SIZE = 1024
_WAY = 1.0 - np.linspace(0.0, 1.0, SHAPE_SIZE + 1)
SHAPE = 0.25 * math.pi - 0.5 * (_WAY * np.sqrt(1.0 - _WAY**2) + np.arcsin(_WAY))


@called
def signal_of(
    pixels: ByteArray, row: int, group: int, signal: FloatArray
) -> None:  # pragma: no cover
    """Write the brightness of three rows, means of groups of columns, shape (groups,)."""
    share = 1.0 / group
    for u in range(signal.size):
        total = 0
        for v in range(row - 1, row + 2):
            for k in range(u * group, (u + 1) * group):
                total += int(pixels[v, k, 0]) + int(pixels[v, k, 1]) + int(pixels[v, k, 2])
        signal[u] = total * share


@called
def edges_of(
    signal: FloatArray,
    half: FloatArray,
    sums: FloatArray,
    strength: FloatArray,
    where: FloatArray,
    plain: FloatArray,
    creased: FloatArray,
) -> tuple[int, float]:  # pragma: no cover
    """Find edges; return how many there are, and the contrast that counts half.

    There are as many as `where` has places at most.

    Args:
        signal: Brightness, shape (columns,).
        half: Half the width of a turn [px], shape (columns,).
        sums: Room for running sums of the signal, shape (columns + 1,).
        strength: Room, shape (columns,).
        where: Places of the edges, ascending, to be written [groups].
        plain: Their strengths, 0 to 1, to be written, dimensionless.
        creased: Share of crease rather than step in each, to be written.
    """
    columns = signal.size
    sums[0] = 0.0
    for u in range(columns):
        sums[u + 1] = sums[u] + signal[u]
        strength[u] = 0.0
    for u in range(columns):
        n = max(1, int(0.2 * half[u] + 0.5))
        if u - n < 0 or u + n + 1 > columns:
            continue
        strength[u] = _strength(sums, u, n)[0]
    # One bright speck is not what the cable looks like.
    plainest, second, third = 0.0, 0.0, 0.0
    for start in range(0, columns, 16):
        best = 0.0
        for u in range(start, min(start + 16, columns)):
            best = max(best, strength[u])
        if best > plainest:
            plainest, second, third = best, plainest, second
        elif best > second:
            second, third = best, second
        elif best > third:
            third = best
    half_contrast = min(max(HALF_SHARE * third, HALF_LEAST), HALF_MOST)
    for u in range(columns):
        square = strength[u] * strength[u]
        strength[u] = square / (square + half_contrast * half_contrast)
    count = 0
    u = 1
    while u < columns - 1:
        s = strength[u]
        if s < LEAST_STRENGTH or s < strength[u - 1] or s <= strength[u + 1]:
            u += 1
            continue
        room = max(1, int(0.3 * half[u] + 0.5))
        beaten = False
        for other in range(max(u - room, 0), min(u + room, columns - 1) + 1):
            if strength[other] > s:
                beaten = True
        if not beaten and count < where.size:
            low, high = strength[u - 1], strength[u + 1]
            bend = low - 2.0 * s + high
            where[count] = u + (0.5 * (low - high) / bend if bend < 0.0 else 0.0)
            plain[count] = s
            creased[count] = _strength(sums, u, max(1, int(0.2 * half[u] + 0.5)))[1]
            count += 1
        u += 1
    return count, half_contrast


@called
def _strength(sums: FloatArray, u: int, n: int) -> tuple[float, float]:  # pragma: no cover
    """Return the contrast of an edge over the brightness, and the share of crease in it."""
    left = (sums[u] - sums[u - n]) / n
    right = (sums[u + n + 1] - sums[u + 1]) / n
    core = n // 3
    middle = (sums[u + core + 1] - sums[u - core]) / (2 * core + 1)
    step = abs(right - left)
    crease = CREASE_GAIN * max(0.5 * (left + right) - middle, 0.0)
    level = max(left, right, middle) + 30.0
    best = max(step, crease)
    share = crease / best if best > 0.0 else 0.0
    return best / level, min(share, 1.0)


@called
def mean_between(sums: FloatArray, low: float, high: float) -> float:  # pragma: no cover
    """Return the mean signal between two places [groups], nan where there is none."""
    first = max(math.ceil(low), 0)
    last = min(math.floor(high), sums.size - 2)
    if last < first:
        return math.nan
    return float((sums[last + 1] - sums[first]) / (last - first + 1))


@called
def _shape(way: float, half: float, scale: float) -> float:  # pragma: no cover
    """Return the integral of the brightness of a round cable over a way from its rim.

    The scale is SHAPE_SIZE / half.
    """
    if way <= 0.0:
        return 0.0
    place = way * scale
    if place >= SHAPE_SIZE:
        return float(half * SHAPE[SHAPE_SIZE] + way - half)
    k = int(place)
    return float(half * (SHAPE[k] + (place - k) * (SHAPE[k + 1] - SHAPE[k])))


@called
def _misfit(
    signal: FloatArray, first: int, last: int, edge: float, half: float, below: bool, above: bool
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
    """
    # One number each, not a matrix: they stay in registers. Each group is a mean over its width, a
    # part of which may lie on either side of the edge; one group at most has parts on both.
    n00 = n01 = n02 = n03 = n11 = n12 = n13 = n22 = n23 = n33 = 0.0
    y0 = y1 = y2 = y3 = squares = 0.0
    scale = SHAPE_SIZE / half
    u = first
    outer = _shape(edge - u + 0.5, half, scale) if below else 0.0
    while u <= last and u + 0.5 <= edge:
        y = signal[u]
        if below:
            inner = _shape(edge - u - 0.5, half, scale)
            lower = outer - inner
            outer = inner
        else:
            lower = edge - u
        squares += y * y
        n00 += 1.0
        n01 += lower
        n11 += lower * lower
        y0 += y
        y1 += lower * y
        u += 1
    if u <= last and u - 0.5 < edge:
        y = signal[u]
        share = u + 0.5 - edge
        rest = 1.0 - share
        lower = outer if below else rest * max(edge - u, 0.0)
        upper = _shape(share, half, scale) if above else share * max(u - edge, 0.0)
        squares += y * y
        n00 += rest * rest
        n01 += rest * lower
        n02 = rest * share
        n03 = rest * upper
        n11 += lower * lower
        n12 = lower * share
        n13 = lower * upper
        n22 = share * share
        n23 = share * upper
        n33 = upper * upper
        y0 += rest * y
        y1 += lower * y
        y2 = share * y
        y3 = upper * y
        u += 1
    inner = _shape(u - 0.5 - edge, half, scale) if above else 0.0
    while u <= last:
        y = signal[u]
        if above:
            outer = _shape(u + 0.5 - edge, half, scale)
            upper = outer - inner
            inner = outer
        else:
            upper = u - edge
        squares += y * y
        n22 += 1.0
        n23 += upper
        n33 += upper * upper
        y2 += y
        y3 += upper * y
        u += 1
    # Cholesky's way, with the right side as a further row: what is left of the squares.
    if n00 > LEAST_PIVOT:
        f = n01 / n00
        n11, n12, n13, y1 = n11 - f * n01, n12 - f * n02, n13 - f * n03, y1 - f * y0
        f = n02 / n00
        n22, n23, y2 = n22 - f * n02, n23 - f * n03, y2 - f * y0
        f = n03 / n00
        n33, y3 = n33 - f * n03, y3 - f * y0
        squares -= y0 * y0 / n00
    if n11 > LEAST_PIVOT:
        f = n12 / n11
        n22, n23, y2 = n22 - f * n12, n23 - f * n13, y2 - f * y1
        f = n13 / n11
        n33, y3 = n33 - f * n13, y3 - f * y1
        squares -= y1 * y1 / n11
    if n22 > LEAST_PIVOT:
        f = n23 / n22
        n33, y3 = n33 - f * n23, y3 - f * y2
        squares -= y2 * y2 / n22
    if n33 > LEAST_PIVOT:
        squares -= y3 * y3 / n33
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
) -> tuple[float, float]:  # pragma: no cover
    """Return the place of an edge and its standard deviation [groups], nan where none is found.

    Args:
        signal: Brightness, shape (groups,).
        edge: Where it is sought [groups].
        half: Half the width of a turn [groups].
        room_below: Way below the edge that belongs to one side [groups].
        room_above: The same above [groups].
        below: Whether there is cable below.
        above: Whether there is cable above.
        steps: That are tried to either side.
        step: Their width [groups].
    """
    first = max(math.ceil(edge - room_below), 0)
    last = min(math.floor(edge + room_above), signal.size - 1)
    count = last - first + 1
    if count < UNKNOWNS + 2:
        return math.nan, math.nan
    best, low, middle, high = 0, math.nan, math.inf, math.nan
    previous = math.nan
    for k in range(-steps, steps + 1):
        misfit = _misfit(signal, first, last, edge + step * k, half, below, above)
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
