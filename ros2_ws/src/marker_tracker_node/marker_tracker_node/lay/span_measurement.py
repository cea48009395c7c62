"""The free span in one picture: found among what its rows show, then measured from all of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import Machine
from marker_tracker_node.lay.free_span import (
    NO_SPAN,
    FreeSpan,
    fit_span,
    sightings_near,
    towards_guide,
)
from marker_tracker_node.lay.row_measurement import MOST_EDGES, NUMBERS, SYSTEMATIC, measure_row
from marker_tracker_node.lay.rows import RowTables
from marker_tracker_node.lay.span_alignment import aligned_rows
from winding_core.compiling import compiled

ByteArray = NDArray[np.uint8]

# How far the cable may be from where it is sought in each row, and where it lands from where it
# should, in cable diameters.
SOUGHT, EXPECTED = 0.6, 0.5
# The same of a straight cable to the guide, where nothing else is known.
STRAIGHT = 0.4


@compiled
def span_in(
    pixels: ByteArray,
    rows: RowTables,
    start: float,
    slope: float,
    guide_z: float,
    machine: Machine,
) -> FreeSpan:  # pragma: no cover
    """Return the free span that a picture shows, NO_SPAN if it shows none.

    Args:
        pixels: Blue-green-red, shape (rows, columns, 3).
        rows: Over the free span.
        start: Where it should land [m], nan if that is not known.
        slope: Its expected dz per way towards the guide.
        guide_z: Where the guide stands [m].
        machine: Cylinder and cable.
    """
    number, groups = rows.z.shape
    found, counts = np.empty((number, MOST_EDGES, NUMBERS)), np.empty(number, dtype=np.int64)
    for k in range(number):
        counts[k] = measure_row(pixels, rows, k, 0.0, found[k])
    if not math.isfinite(start):
        limit = STRAIGHT * machine.diameter
        start = towards_guide(found, counts, guide_z, machine.free_length, limit, machine.onward)
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
