"""One row of a picture: the turns of cable that it shows, with where each of them lies."""

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.edges import (
    COARSE_STEPS,
    FINE_STEP,
    FINE_STEPS,
    WIDE_STEPS,
    edges_of,
    refined_edge,
    signal_of,
)
from marker_tracker_node.lay.rows import RowTables
from marker_tracker_node.lay.segments import (
    BARE,
    HIDDEN_ABOVE,
    HIDDEN_BELOW,
    WHOLE,
    Edges,
    Explanation,
    bulge,
    explain,
)
from winding_core.compiling import called

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

MOST_EDGES = 256
# Edges as plain as this are looked at closely; those nearer to each other than this share of half a
# turn are one.
WORTH_MOVING, SAME_EDGE = 0.3, 0.15
# Bulge that counts half, over the contrast of an edge that does; and over that of the row's turns.
HALF_BULGE, USUAL_BULGE = 0.4, 0.6
COARSE_SIGMA = 0.4  # An edge that is no better known than where its contrast is greatest [px]
# What edges of real and drawn cables are off by for reasons that no scatter shows [px].
SYSTEMATIC = 0.06
# An edge is fitted within this share of half a turn on both its sides, but not less than [px].
FITTED_SHARE, FITTED_LEAST = 0.6, 3.2
# A gap that is narrower than a pixel or two looks like the crease of turns that touch, half of it
# beyond the rim of either [px].
GAP_DOUBT = 0.35
WIDTH_DOUBT = 0.02  # By which share of half a turn its configured width may be off

# What is known of a turn in a row, see `measure_row`.
PLACE, Z, SIGMA, WIDTH, STEEP, REACH, KIND = range(7)
NUMBERS = 7


@called
def measure_row(
    pixels: ByteArray, rows: RowTables, k: int, slant: float, found: FloatArray
) -> int:  # pragma: no cover
    """Write the turns that a row shows, by rising column, and return their number.

    Args:
        pixels: Blue-green-red, shape (rows, columns, 3).
        rows: What the rows look at.
        k: Which of them is measured.
        slant: Expected dz per way around the cylinder.
        found: To be written, shape (MOST_EDGES, NUMBERS): place (azimuth [rad], or way on the free
            span [m]), z [m] as of a turn on the cylinder, its standard deviation [m], the visible
            width over the cable's, steepness and reach of the ray (`RowTables`), and the kind
            (`segments`).
    """
    columns = rows.z.shape[1]
    signal, strength = np.empty(columns), np.empty(columns)
    sums = np.empty(columns + 1)
    where, plain, creased = np.empty(MOST_EDGES), np.empty(MOST_EDGES), np.empty(MOST_EDGES)
    signal_of(pixels, rows.row[k], rows.group, signal)
    half, all_z, all_places = rows.half[k], rows.z[k], rows.place[k]
    count, half_contrast = edges_of(signal, half, sums, strength, where, plain, creased)
    count = _moved_to_rims(signal, half, where, plain, creased, count)
    if count < 2:
        return 0
    room = Explanation(
        np.empty((count, 4)),
        np.empty((count, 4), dtype=np.int64),
        np.empty((count, 4), dtype=np.int64),
    )
    edges = Edges(where, plain, creased, sums, half)
    half_bulge = HALF_BULGE * half_contrast
    edge, kind = explain(edges, count, half_bulge, room)
    usual = USUAL_BULGE * _usual_bulge(edges, room, edge, kind)
    if usual > half_bulge:
        edge, kind = explain(edges, count, usual, room)
    # From the last part back to the first; then each part knows its neighbours.
    first, last, kinds = np.empty(count + 1), np.empty(count + 1), np.empty(count + 1)
    parts = 0
    while edge >= 0:
        start, before = room.last[edge, kind], room.before[edge, kind]
        if kind != BARE and start >= 0:
            first[parts], last[parts], kinds[parts] = where[start], where[edge], kind
            parts += 1
        edge, kind = start, before
    stretch = math.sqrt(1.0 + slant * slant)
    number = 0
    for part in range(parts - 1, -1, -1):
        own = half[int(0.5 * (first[part] + last[part]))] * stretch
        touched_below = part + 1 < parts and last[part + 1] == first[part]
        touched_above = part > 0 and first[part - 1] == last[part]
        kind = int(kinds[part])
        wide = last[part] - first[part]
        low, low_sigma = math.nan, math.nan
        if kind != HIDDEN_BELOW:
            width_below = last[part + 1] - first[part + 1] if touched_below else math.inf
            cable_below = touched_below and kinds[part + 1] != HIDDEN_ABOVE
            low, low_sigma = _edge(signal, first[part], own, width_below, wide, cable_below, True)
            low_sigma = math.hypot(low_sigma, GAP_DOUBT * cable_below)
        high, high_sigma = math.nan, math.nan
        if kind != HIDDEN_ABOVE:
            width_above = last[part - 1] - first[part - 1] if touched_above else math.inf
            cable_above = touched_above and kinds[part - 1] != HIDDEN_BELOW
            high, high_sigma = _edge(signal, last[part], own, wide, width_above, True, cable_above)
            high_sigma = math.hypot(high_sigma, GAP_DOUBT * cable_above)
        if kind == WHOLE:
            # Edges that are known as well weigh the same, however wide the turn looks.
            doubt = WIDTH_DOUBT * own
            one, other = low_sigma**2 + doubt * doubt, high_sigma**2 + doubt * doubt
            share = one / (one + other)
            column = (1.0 - share) * (low + own) + share * (high - own)
            sigma = math.sqrt((1.0 - share) ** 2 * low_sigma**2 + share**2 * high_sigma**2)
            sigma = math.hypot(sigma, abs(1.0 - 2.0 * share) * doubt)
        elif kind == HIDDEN_ABOVE:
            column, sigma = low + own, low_sigma
        else:
            column, sigma = high - own, high_sigma
        if not 1.0 <= column <= columns - 2.0:
            continue
        u = int(column)
        share = column - u
        z = all_z[u] + share * (all_z[u + 1] - all_z[u])
        per_column = abs(all_z[u + 1] - all_z[u])
        found[number, PLACE] = all_places[u] + share * (all_places[u + 1] - all_places[u])
        found[number, Z] = z
        found[number, SIGMA] = per_column * math.hypot(sigma, SYSTEMATIC)
        found[number, WIDTH] = wide / (2.0 * own)
        found[number, STEEP] = rows.steep[k, u]
        found[number, REACH] = rows.reach[k, u]
        found[number, KIND] = kind
        number += 1
    return number


@called
def _usual_bulge(
    edges: Edges, room: Explanation, edge: int, kind: int
) -> float:  # pragma: no cover
    """Return the bulge of the turns of an explanation, the greatest but one if there are three."""
    greatest, second, number = 0.0, 0.0, 0
    while edge >= 0:
        start, before = room.last[edge, kind], room.before[edge, kind]
        if kind == WHOLE and start >= 0:
            number += 1
            rise = bulge(edges, edges.where[start], edges.where[edge])
            if rise > greatest:
                greatest, second = rise, greatest
            elif rise > second:
                second = rise
        edge, kind = start, before
    return second if number > 2 else greatest


@called
def _moved_to_rims(
    signal: FloatArray,
    half: FloatArray,
    where: FloatArray,
    plain: FloatArray,
    creased: FloatArray,
    count: int,
) -> int:  # pragma: no cover
    """Move plain edges to where a rim explains them; return how many distinct ones there are.

    The brightness of a round cable rises so steeply from its rim that the greatest contrast lies
    a fifth of half its width within it.
    """
    kept = 0
    for k in range(count):
        place, own = where[k], half[int(where[k])]
        if plain[k] > WORTH_MOVING:
            room = max(FITTED_SHARE * own, FITTED_LEAST) + 0.15 * own
            step = 0.25 + 0.045 * own
            moved, _ = refined_edge(signal, place, own, room, room, True, True, COARSE_STEPS, step)
            if math.isfinite(moved):
                place = moved
        if kept and place < where[kept - 1] + SAME_EDGE * own:
            if plain[k] <= plain[kept - 1]:
                continue
            kept -= 1
        where[kept], plain[kept], creased[kept] = place, plain[k], creased[k]
        kept += 1
    return kept


@called
def _edge(
    signal: FloatArray,
    edge: float,
    half: float,
    width_below: float,
    width_above: float,
    below: bool,
    above: bool,
) -> tuple[float, float]:  # pragma: no cover
    """Return the column of an edge and its standard deviation [px], coarse ones if need be."""
    room = max(FITTED_SHARE * half, FITTED_LEAST)
    below_room, above_room = min(room, 0.9 * width_below), min(room, 0.9 * width_above)
    place, sigma = refined_edge(
        signal, edge, half, below_room, above_room, below, above, FINE_STEPS, FINE_STEP
    )
    if not math.isfinite(place):
        place, sigma = refined_edge(
            signal, edge, half, below_room, above_room, below, above, WIDE_STEPS, FINE_STEP
        )
    if not math.isfinite(place) or sigma > COARSE_SIGMA:
        return edge, COARSE_SIGMA
    return place, sigma


@called
def median(values: NDArray[np.float64], count: int) -> float:  # pragma: no cover
    """Return the median of the first numbers of an array, which sorts them.

    Args:
        values: Shape (n,).
        count: How many count, 1 at least; they are sorted in place.
    """
    for k in range(1, count):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    return float(0.5 * (values[(count - 1) // 2] + values[count // 2]))
