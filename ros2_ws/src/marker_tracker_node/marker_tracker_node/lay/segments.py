"""Which edges of a row bound turns of cable: the best explanation of the whole row.

A turn is two edges as far apart as the cable is wide, with a brightness that bulges between them;
of a turn that others lie on, a part is seen. What is none of this is bare. The explanation with
the greatest score is found over all choices of edges, by dynamic programming.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.edges import mean_between
from winding_core.compiling import called

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

BARE, WHOLE, HIDDEN_ABOVE, HIDDEN_BELOW = 0, 1, 2, 3

BOUNDARY_COST = 0.25  # What a boundary costs, and what it earns beyond that is its strength
# Of an edge that the explanation leaves over, in bare rows and within a turn.
BARE_EDGE, INNER_CREASE, INNER_STEP = 0.8, 0.6, 0.1
# Of this strength are the grooves of the cylinder too.
GROOVE = 0.2
BULGE_GAIN, WHOLE_COST, PART_COST = 1.2, 0.75, 0.6
# A turn may look wider than it is where it runs at a slant or a fine gap melts into its edges.
NARROWEST, WIDEST = 0.9, 1.16
LEAST_PART, MOST_PART = 0.16, 0.93
PLAY = 1.2


class Edges(NamedTuple):
    """Edges of a row and its brightness, see `edges_of`; half a turn's width in groups."""

    where: FloatArray
    plain: FloatArray
    creased: FloatArray
    sums: FloatArray
    half: FloatArray


class Explanation(NamedTuple):
    """Room for the best explanations that end at an edge, arrays of shape (count, 4)."""

    score: FloatArray  # Of the best explanation of which the last part has a kind
    last: IndexArray  # Edge at which that part begins, -1 for the picture's margin
    before: IndexArray  # Kind of the part before it


@called
def bulge(edges: Edges, low: float, high: float) -> float:  # pragma: no cover
    """Return by how much the middle is brighter than both flanks, a share of the brightness."""
    width = high - low
    trim = min(0.5, 0.06 * width)
    middle = mean_between(edges.sums, low + 0.32 * width, high - 0.32 * width)
    left = mean_between(edges.sums, low + trim, low + 0.25 * width)
    right = mean_between(edges.sums, high - 0.25 * width, high - trim)
    if not math.isfinite(middle):
        middle = mean_between(edges.sums, low + 0.3 * width, high - 0.2 * width)
    if not (math.isfinite(left) and math.isfinite(right) and math.isfinite(middle)):
        return 0.0
    return (middle - 0.5 * (left + right)) / (max(left, right, middle) + 30.0)


@called
def _left_over(edges: Edges, k: int) -> float:  # pragma: no cover
    """Return what an edge costs that bounds nothing."""
    return float(BARE_EDGE * max(edges.plain[k] - GROOVE, 0.0))


@called
def _inner(edges: Edges, i: int, j: int) -> float:  # pragma: no cover
    """Return what the edges within a turn from edge i to edge j cost."""
    cost = 0.0
    low, width = edges.where[i], edges.where[j] - edges.where[i]
    for k in range(i + 1, j):
        if 0.12 * width < edges.where[k] - low < 0.88 * width:
            crease = edges.creased[k]
            price = INNER_CREASE if crease > 0.7 else INNER_STEP
            cost += edges.plain[k] * price
    return cost


@called
def explain(
    edges: Edges, count: int, half_bulge: float, room: Explanation
) -> tuple[int, int]:  # pragma: no cover
    """Find the best explanation of a row.

    Args:
        edges: Of the row.
        count: How many there are.
        half_bulge: Bulge that counts half, dimensionless.
        room: To be written.

    Returns:
        Edge and kind of the last part before the margin, -1 and BARE for a bare row.
    """
    score, last, before = room.score, room.last, room.before
    margin = 0.0
    best_margin, best_edge, best_kind = 0.0, -1, BARE
    # The best that ends with a turn before an edge and with bare cylinder since.
    after, after_edge, after_kind, before_left = -math.inf, -1, BARE, 0.0
    for j in range(count):
        earned = edges.plain[j] - BOUNDARY_COST
        left = _left_over(edges, j)
        for kind in range(4):
            score[j, kind] = -math.inf
            last[j, kind] = -1
            before[j, kind] = BARE
        # The bare beginning of the row up to this edge.
        score[j, BARE] = margin + earned
        margin -= left
        # After a turn that shows its upper edge, bare cylinder.
        if j > 0:
            after -= before_left
            for kind in (WHOLE, HIDDEN_BELOW):
                if score[j - 1, kind] >= after:
                    after, after_edge, after_kind = score[j - 1, kind], j - 1, kind
            if after + earned > score[j, BARE]:
                score[j, BARE] = after + earned
                last[j, BARE], before[j, BARE] = after_edge, after_kind
        before_left = left
        for i in range(j - 1, -1, -1):
            half = edges.half[int(0.5 * (edges.where[i] + edges.where[j]))]
            width = edges.where[j] - edges.where[i]
            share = width / (2.0 * half)
            play = PLAY / (2.0 * half)
            if share > WIDEST + play:
                break
            inner = _inner(edges, i, j)
            if NARROWEST - play < share < WIDEST + play:
                misfit = max(abs(share - 1.0) - 0.5 * play, 0.0)
                rise = bulge(edges, edges.where[i], edges.where[j])
                plainness = rise * abs(rise) / (rise * rise + half_bulge * half_bulge)
                worth = BULGE_GAIN * plainness
                worth -= WHOLE_COST + 4.0 * misfit + inner
                for kind in range(4):
                    value = score[i, kind] + worth + earned
                    if value > score[j, WHOLE]:
                        score[j, WHOLE], last[j, WHOLE], before[j, WHOLE] = value, i, kind
            if share < MOST_PART and width > max(LEAST_PART * 2.0 * half, 1.5):
                worth = -PART_COST - inner
                for kind in (BARE, WHOLE, HIDDEN_BELOW):
                    value = score[i, kind] + worth + earned
                    if value > score[j, HIDDEN_ABOVE]:
                        score[j, HIDDEN_ABOVE] = value
                        last[j, HIDDEN_ABOVE], before[j, HIDDEN_ABOVE] = i, kind
                value = score[i, WHOLE] + worth + earned
                if value > score[j, HIDDEN_BELOW]:
                    score[j, HIDDEN_BELOW] = value
                    last[j, HIDDEN_BELOW], before[j, HIDDEN_BELOW] = i, WHOLE
    # What follows the last turn up to the margin is bare.
    best_margin = margin
    rest = 0.0
    for j in range(count - 1, -1, -1):
        for kind in (WHOLE, HIDDEN_BELOW):
            if score[j, kind] + rest > best_margin:
                best_margin, best_edge, best_kind = score[j, kind] + rest, j, kind
        rest -= _left_over(edges, j)
    return best_edge, best_kind
