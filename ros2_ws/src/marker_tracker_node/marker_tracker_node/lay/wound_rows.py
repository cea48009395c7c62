"""One row over the wound cable: its turns are measured, numbered, and added to what is known."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import Machine
from marker_tracker_node.lay.numbering import TURN, Moment, number_turns
from marker_tracker_node.lay.row_measurement import (
    KIND,
    MOST_EDGES,
    NUMBERS,
    PLACE,
    SIGMA,
    STEEP,
    SYSTEMATIC,
    Z,
    measure_row,
)
from marker_tracker_node.lay.rows import RowTables
from marker_tracker_node.lay.segments import WHOLE
from marker_tracker_node.lay.turn_map import Places, add_sighting, expected_near
from winding_core.compiling import compiled

ByteArray = NDArray[np.uint8]

# Over so much cable before and after a place its slope is told [rad].
BESIDE = 0.2


@compiled
def take_row(
    pixels: ByteArray,
    rows: RowTables,
    k: int,
    places: Places,
    machine: Machine,
    moment: Moment,
) -> int:  # pragma: no cover
    """Add what a row shows to what is known; return the number of turns.

    Args:
        pixels: Blue-green-red, shape (rows, columns, 3).
        rows: Over the wound cable.
        k: Which of them is measured.
        places: What is known, to be improved.
        machine: Cylinder and cable.
        moment: Where they stand.
    """
    found = np.empty((MOST_EDGES, NUMBERS))
    found = found[: measure_row(pixels, rows, k, moment.slope / machine.rho, found)]
    numbers = np.empty(found.shape[0], dtype=np.int64)
    number_turns(found, places, machine, moment, numbers)
    half = rows.half[k]
    floor = SYSTEMATIC * machine.radius / half[half.size // 2]
    number = 0
    for index in range(numbers.size):
        if numbers[index] < 0:
            continue
        turn = found[index]
        theta = moment.angle - turn[PLACE] - TURN * numbers[index]
        before = expected_near(places, theta - BESIDE, BESIDE, moment.slope)
        after = expected_near(places, theta + BESIDE, BESIDE, moment.slope)
        slope = (after - before) / (2.0 * BESIDE)
        if not math.isfinite(slope):
            slope = moment.slope
        add_sighting(
            places, theta, turn[Z], slope, turn[SIGMA], floor, turn[KIND] == WHOLE, turn[STEEP]
        )
        number += 1
    return number
