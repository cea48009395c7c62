"""The free span in one picture: found among its rows, which are then laid over each other.

All rows show the same cable in the same light. Where each of them stands against the mean of all
is known better than any edge, whose fit errs with the place of the edge within its pixel.
"""

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import Machine
from marker_tracker_node.lay.edges import signal_of
from marker_tracker_node.lay.free_span import (
    NO_SPAN,
    FreeSpan,
    fit_span,
    sightings_near,
    towards_guide,
)
from marker_tracker_node.lay.row_measurement import MOST_EDGES, NUMBERS, SYSTEMATIC, measure_row
from marker_tracker_node.lay.rows import RowTables
from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# A pixel that the rim runs through shows what stands behind the cable: so far from the rim [groups]
# rows are compared, but within this share of half the width at least.
RIM, LEAST_INSIDE = 1.5, 0.5
SAMPLES = 49
PASSES = 2
LEAST_PIVOT = 1.0e-12
# How far the cable may be from where it is sought in each row, and where it lands from where it
# should, in cable diameters.
SOUGHT, EXPECTED = 0.6, 0.5
STRAIGHT = 0.4  # The same of a straight cable to the guide, where nothing else is known


@called
def aligned_rows(
    pixels: ByteArray, rows: RowTables, span: FreeSpan, seen: FloatArray
) -> None:  # pragma: no cover
    """Write way [m], z [m] and the standard deviation of z [m] of each row's cable.

    Args:
        pixels: Blue-green-red, shape (rows, columns, 3).
        rows: Over the free span.
        span: As the edges give it; its mean z is kept.
        seen: To be written, shape (3, rows).
    """
    number, groups = rows.z.shape
    signals = np.empty((number, groups))
    columns, halves, scales = np.empty(number), np.empty(number), np.empty(number)
    slope = math.tan(span.angle)
    for k in range(number):
        signal_of(pixels, rows.row[k], rows.group, signals[k])
        way = rows.place[k, groups // 2]
        columns[k] = _column_of(rows.z[k], span.contact_z + slope * way)
        u = min(max(int(columns[k]), 0), groups - 2)
        seen[0, k] = rows.place[k, u]
        halves[k] = rows.half[k, u] / math.cos(span.angle)
        scales[k] = rows.z[k, u + 1] - rows.z[k, u]
    inside = max(1.0 - RIM / halves.min(), LEAST_INSIDE)
    moved, sigma = np.zeros(number), np.empty(number)
    profiles = np.empty((number, SAMPLES))
    for _ in range(PASSES):
        for k in range(number):
            _profile(signals[k], columns[k] + moved[k], inside * halves[k], profiles[k])
        _compare(profiles, inside * halves, moved, sigma)
    mean, weights = 0.0, 0.0
    for k in range(number):
        weight = 1.0 / max(sigma[k], 1.0e-3) ** 2
        mean += weight * moved[k]
        weights += weight
    for k in range(number):
        column = min(max(columns[k] + moved[k] - mean / weights, 0.0), groups - 1.0)
        u = min(int(column), groups - 2)
        seen[1, k] = rows.z[k, u] + (column - u) * (rows.z[k, u + 1] - rows.z[k, u])
        seen[2, k] = max(sigma[k], 0.01) * abs(scales[k])


@called
def _column_of(z: FloatArray, wanted: float) -> float:  # pragma: no cover
    """Return where rising places reach one, by linear interpolation, within them."""
    low, high = 0, z.size - 1
    if wanted <= z[low]:
        return float(low)
    if wanted >= z[high]:
        return float(high)
    while high - low > 1:
        middle = (low + high) // 2
        if z[middle] <= wanted:
            low = middle
        else:
            high = middle
    return low + float((wanted - z[low]) / (z[high] - z[low]))


@called
def _profile(
    signal: FloatArray, column: float, reach: float, profile: FloatArray
) -> None:  # pragma: no cover
    """Write a cable's brightness over its mean, by cubic interpolation, shape (SAMPLES,)."""
    total = 0.0
    for i in range(SAMPLES):
        at = column + reach * (2.0 * i / (SAMPLES - 1) - 1.0)
        low = min(max(math.floor(at), 1), signal.size - 3)
        t = at - low
        a, b, c, d = signal[low - 1], signal[low], signal[low + 1], signal[low + 2]
        bend = 2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)
        profile[i] = b + 0.5 * t * (c - a + t * bend)
        total += profile[i]
    if total > 0.0:
        for i in range(SAMPLES):
            profile[i] *= SAMPLES / total


@called
def _compare(
    profiles: FloatArray, reaches: FloatArray, moved: FloatArray, sigma: FloatArray
) -> None:  # pragma: no cover
    """Move each row to where it fits the mean of all, and tell how well it does.

    What a row shows is the mean, brighter or darker, with more or less contrast, and moved.

    Args:
        profiles: Over their means, shape (rows, SAMPLES).
        reaches: Half the width that is compared in each row [groups], shape (rows,).
        moved: By how much each row is moved [groups], shape (rows,), to be improved.
        sigma: Standard deviation of that [groups], shape (rows,), to be written.
    """
    number = reaches.size
    mean, steep = np.zeros(SAMPLES), np.empty(SAMPLES)
    for k in range(number):
        for i in range(SAMPLES):
            mean[i] += profiles[k, i] / number
    for i in range(SAMPLES):
        low, high = max(i - 1, 0), min(i + 1, SAMPLES - 1)
        steep[i] = 0.5 * (mean[high] - mean[low]) * (SAMPLES - 1) / (high - low)
    level = tilt = spread = 0.0
    for i in range(SAMPLES):
        level += mean[i] / SAMPLES
        tilt += steep[i] / SAMPLES
        spread += steep[i] ** 2 / SAMPLES
    cc = ct = tt = 0.0
    for i in range(SAMPLES):
        contrast, change = mean[i] - level, steep[i] - tilt
        cc += contrast * contrast
        ct += contrast * change
        tt += change * change
    determinant = cc * tt - ct * ct
    if determinant <= LEAST_PIVOT:
        # All the same from rim to rim: nothing tells where a row stands.
        for k in range(number):
            sigma[k] = reaches[k]
        return
    for k in range(number):
        base, cy, ty = 0.0, 0.0, 0.0
        for i in range(SAMPLES):
            base += profiles[k, i] / SAMPLES
            cy += (mean[i] - level) * profiles[k, i]
            ty += (steep[i] - tilt) * profiles[k, i]
        gain, shift = (cy * tt - ty * ct) / determinant, (ty * cc - cy * ct) / determinant
        left = 0.0
        for i in range(SAMPLES):
            explained = base + gain * (mean[i] - level) + shift * (steep[i] - tilt)
            left += (profiles[k, i] - explained) ** 2 / SAMPLES
        moved[k] -= shift * reaches[k] / max(gain, 0.3)
        # As many samples tell something of their own as there are groups of columns.
        own = math.sqrt(max(2.0 * reaches[k], 1.0))
        sigma[k] = reaches[k] * math.sqrt(left) / (math.sqrt(max(spread, 1.0e-12)) * own)


@compiled
def span_in(
    pixels: ByteArray,
    rows: RowTables,
    start: float,
    slope: float,
    guide_z: float,
    last: float,
    reach: float,
    machine: Machine,
) -> tuple[float, float, float, float, int]:  # pragma: no cover
    """Return the fields of the free span that a picture shows, of NO_SPAN if it shows none.

    Args:
        pixels: Blue-green-red, shape (rows, columns, 3).
        rows: Over the free span.
        start: Where it should land [m], nan if that is not known.
        slope: Its expected dz per way towards the guide.
        guide_z: Where the guide stands [m].
        last: Where the cable landed when that was known [m].
        reach: How far from there it may land [m].
        machine: Cylinder and cable.
    """
    span = _span_in(pixels, rows, start, slope, guide_z, last, reach, machine)
    return span.angle, span.sigma_angle, span.contact_z, span.sigma_contact_z, span.rows


@called
def _span_in(
    pixels: ByteArray,
    rows: RowTables,
    start: float,
    slope: float,
    guide_z: float,
    last: float,
    reach: float,
    machine: Machine,
) -> FreeSpan:  # pragma: no cover
    """Return what `span_in` has the fields of."""
    number, groups = rows.z.shape
    found, counts = np.empty((number, MOST_EDGES, NUMBERS)), np.empty(number, dtype=np.int64)
    for k in range(number):
        counts[k] = measure_row(pixels, rows, k, 0.0, found[k])
    if not math.isfinite(start):
        limit = STRAIGHT * machine.diameter
        start = towards_guide(found, counts, guide_z, last, reach, limit, machine)
        slope = (guide_z - start) / machine.free_length
    if not math.isfinite(start):
        return NO_SPAN
    seen = np.empty((3, number))
    count = sightings_near(found, counts, start, slope, SOUGHT * machine.diameter, seen)
    floor = SYSTEMATIC * machine.radius / rows.half[0, groups // 2]
    edges = fit_span(seen[0, :count], seen[1, :count], seen[2, :count], floor)
    if edges.rows == 0:
        return NO_SPAN
    aligned_rows(pixels, rows, edges, seen)
    span = fit_span(seen[0], seen[1], seen[2], edges.sigma_contact_z)
    if span.rows == 0:
        span = edges
    return span if abs(span.contact_z - start) <= EXPECTED * machine.diameter else NO_SPAN
