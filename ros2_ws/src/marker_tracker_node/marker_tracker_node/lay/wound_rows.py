"""One row over the wound cable: its turns are measured, numbered, and added to what is known."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import Machine
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
    median,
)
from marker_tracker_node.lay.rows import RowTables
from marker_tracker_node.lay.segments import WHOLE
from marker_tracker_node.lay.turn_map import (
    LED,
    Places,
    add_sighting,
    expected_near,
    led_on,
    unseen_for,
)
from winding_core.compiling import called, compiled

ByteArray = NDArray[np.uint8]

# Over so much cable before and after a place its slope is measured [rad].
BESIDE = 0.2
FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
TURN = 2.0 * math.pi
REACH = 0.5  # How far the map is carried on along the cable [rad]
# An older turn lies still: one that is seen so far from where it is known is another one. All in
# cable diameters; one that a newer turn lies nearer to than COVERED is not seen whole.
SETTLED, COVERED = 0.25, 0.75
# Deviation of where older turns are seen, and of the newest one where it was seen just before; it
# grows by so much for each radian since. So far from there it may lie where it slid.
STILL, NEAR, NEAR_GROWTH, FARTHEST = 0.03, 0.08, 0.3, 0.8
# Share of places that lie anywhere within these limits, and of rows that do not show the newest
# turn, and of hidden turns that pass for whole; density of what is no known turn [1/diameter].
TAILS, MISSED, MISTAKEN, UNKNOWN = 0.05, 0.05, 0.2, 0.05
TAIL = 0.6  # Cable that may be clamped behind P0 [rad]


@compiled
def take_row(
    pixels: ByteArray, rows: RowTables, k: int, places: Places, machine: Machine, moment: Moment
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


class Moment(NamedTuple):
    """Where machine and cable stand in a frame."""

    angle: float  # Azimuth of P0, whole turns included [rad]
    slope: float  # dz/dtheta of the newest turn [m/rad]
    landing: float  # z where the cable lands [m], nan if unknown
    guide: float  # z of the guide [m], nan if unknown
    farthest: float  # Way along the winding beyond which there is no cable [m]


@called
def number_turns(
    found: FloatArray, places: Places, machine: Machine, moment: Moment, numbers: IndexArray
) -> None:  # pragma: no cover
    """Count the whole turns that lie between each sighting and the contact line.

    A sighting at azimuth a whose number is m was wound at the angle `angle` - a - 2 pi m.

    Args:
        found: Turns of a row, see `measure_row`; shape (n, 7).
        places: What is known.
        machine: Cylinder and cable.
        moment: Where they stand.
        numbers: To be written, -1 for what is no turn, shape (n,).
    """
    for k in range(numbers.size):
        numbers[k] = -1
    if numbers.size == 0:
        return
    # A row stands at nearly the same azimuth everywhere.
    azimuths = np.empty(numbers.size)
    for k in range(numbers.size):
        azimuths[k] = found[k, PLACE]
    azimuth = median(azimuths, numbers.size)
    front = moment.angle - azimuth
    turns = max(math.floor((front + TAIL) / TURN) + 1, 0)
    expected = np.empty(turns)
    for m in range(turns):
        expected[m] = expected_near(places, front - TURN * m, REACH, moment.slope)
    if turns:
        ahead = led_on(places, front, moment.guide, machine)
        if math.isfinite(ahead):
            expected[0] = ahead
        elif math.isnan(expected[0]) and math.isfinite(moment.landing):
            expected[0] = moment.landing - moment.slope * azimuth
        _number_newest(found, machine, expected, unseen_for(places, front, LED), numbers)
    # What others lie on is seen in part.
    limit = SETTLED * machine.diameter
    for m in range(1, turns):
        covered = _is_covered(m, 0, expected, COVERED * machine.diameter)
        tried, tried_miss = -1, -1.0
        while True:
            index, miss = -1, limit
            for k in range(numbers.size):
                off = abs(found[k, Z] - expected[m])
                new = off > tried_miss or (off == tried_miss and k > tried)
                if off < miss and new:
                    index, miss = k, off
            if index < 0:
                break
            if found[index, KIND] == WHOLE:
                fits = not covered
            else:
                fits = not _older_is_nearer(found[index, Z], miss, m, expected)
            if numbers[index] < 0 and fits:
                numbers[index] = m
                break
            tried, tried_miss = index, miss
    _number_unknown(found, machine, moment, front, expected, numbers)


@called
def _older_is_nearer(
    z: float, miss: float, m: int, expected: FloatArray
) -> bool:  # pragma: no cover
    """Return whether an older turn than m is expected nearer to z [m] than `miss` [m]."""
    nearer = False
    for k in range(m + 1, expected.size):
        nearer = nearer or abs(z - expected[k]) < miss
    return nearer


@called
def _number_newest(
    found: FloatArray, machine: Machine, expected: FloatArray, carried: float, numbers: IndexArray
) -> None:  # pragma: no cover
    """Number the newest turn, on which nothing lies: it is seen whole.

    The likeliest explanation of all whole turns decides, the newest being each of them in turn, or
    not seen. The newest hides older ones that lie near it, and so does each of these.

    Args:
        found: Turns of a row, see `measure_row`; shape (n, 7).
        machine: Cylinder and cable.
        expected: z of each turn from the newest on [m], nan where it is unknown.
        carried: Way for which the newest turn has not been seen [rad].
        numbers: To be written, shape (n,).
    """
    near = math.hypot(NEAR, NEAR_GROWTH * carried)
    best, likeliest = -1, math.log(MISSED) + _log_of_others(found, -1, expected, machine)
    for k in range(numbers.size):
        off = abs(found[k, Z] - expected[0]) / machine.diameter
        if found[k, KIND] == WHOLE and off < FARTHEST:
            value = math.log((1.0 - MISSED) * _density(off, near, FARTHEST))
            value += _log_of_others(found, k, expected, machine)
            if value > likeliest:
                best, likeliest = k, value
    if best >= 0:
        numbers[best] = 0
        expected[0] = found[best, Z]


@called
def _density(off: float, sigma: float, farthest: float) -> float:  # pragma: no cover
    """Return the density of a normal error with even tails, all in diameters."""
    bell = math.exp(-0.5 * (off / sigma) ** 2) / (math.sqrt(TURN) * sigma)
    return (1.0 - TAILS) * bell + (0.5 * TAILS / farthest if off < farthest else 0.0)


@called
def _log_of_others(
    found: FloatArray, newest: int, expected: FloatArray, machine: Machine
) -> float:  # pragma: no cover
    """Return the log likelihood of the whole turns beside the newest one that could be it.

    Args:
        found: Turns of a row, see `measure_row`; shape (n, 7).
        newest: Which of them is the newest turn, -1 for none.
        expected: z of each turn from the newest on [m], nan where it is unknown.
        machine: Cylinder and cable.
    """
    total = 0.0
    for k in range(found.shape[0]):
        z = found[k, Z]
        if k == newest or found[k, KIND] != WHOLE:
            continue
        if not abs(z - expected[0]) < (FARTHEST + COVERED) * machine.diameter:
            continue
        density = UNKNOWN
        for m in range(1, expected.size):
            off = abs(z - expected[m]) / machine.diameter
            if off < SETTLED:
                hidden = _is_covered(m, 1, expected, COVERED * machine.diameter) or (
                    newest >= 0 and abs(found[newest, Z] - expected[m]) < COVERED * machine.diameter
                )
                share = MISTAKEN if hidden else 1.0
                density = max(density, share * _density(off, STILL, SETTLED))
        total += math.log(density)
    return total


@called
def _is_covered(
    m: int, newest: int, expected: FloatArray, limit: float
) -> bool:  # pragma: no cover
    """Return whether a newer turn than m, from `newest` on, is expected within a limit [m]."""
    covered = False
    for k in range(newest, m):
        covered = covered or abs(expected[m] - expected[k]) < limit
    return covered


@called
def _number_unknown(
    found: FloatArray,
    machine: Machine,
    moment: Moment,
    front: float,
    expected: FloatArray,
    numbers: IndexArray,
) -> None:  # pragma: no cover
    """Number what is left by its order along the cylinder, if as many are left as there must be."""
    for m in range(1, expected.size):
        for k in range(m):
            if machine.onward * (expected[m] - expected[k]) > machine.radius:
                # The winding has turned back: there is no order along the cylinder.
                return
    newest = moment.farthest
    known = False
    for k in range(numbers.size):
        if numbers[k] >= 0:
            ahead = machine.onward * found[k, Z]
            newest = max(newest, ahead) if known else ahead
            known = True
    newest = min(newest, moment.farthest)
    left, count = np.empty(numbers.size, dtype=np.int64), 0
    for k in range(numbers.size):
        ahead = machine.onward * found[k, Z]
        whole = numbers[k] < 0 and found[k, KIND] == WHOLE
        if whole and -machine.diameter < ahead < newest:
            # From the newest to the oldest.
            place = count
            while place > 0 and machine.onward * found[left[place - 1], Z] < ahead:
                left[place] = left[place - 1]
                place -= 1
            left[place] = k
            count += 1
    sure, unknown, needed = math.floor(front / TURN) + 1, 0, 0
    for m in range(expected.size):
        if math.isnan(expected[m]):
            unknown += 1
            needed += m < sure
    # The length of the tail behind P0 is unobservable.
    if needed <= count <= unknown:
        place = 0
        for m in range(expected.size):
            if math.isnan(expected[m]) and place < count:
                numbers[left[place]] = m
                place += 1
