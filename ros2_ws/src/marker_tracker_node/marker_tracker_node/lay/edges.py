"""Places along a row where the brightness steps or has a crease, whatever their sign."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# Share of the row's plainest contrast at which an edge counts half, and its limits relative to the
# brightness: beyond the grooves of turned metal, and beyond noise.
HALF_SHARE, HALF_LEAST, HALF_MOST = 0.6, 0.04, 0.2
# A crease of depth c is as plain as a step of this many times c.
CREASE_GAIN = 2.5
# What is less plain is noise.
LEAST_STRENGTH = 0.1


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
