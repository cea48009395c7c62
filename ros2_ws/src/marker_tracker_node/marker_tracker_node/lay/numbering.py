"""Which turn each sighting in a row belongs to."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.row_measurement import KIND, PLACE, Z
from marker_tracker_node.lay.segments import WHOLE
from marker_tracker_node.lay.turn_map import TurnMap

FloatArray = NDArray[np.float64]

TURN = 2.0 * math.pi
# How far the map is carried on along the cable [rad].
REACH = 0.5
# How far from where it is expected a turn is still the same, in cable diameters; where it just
# landed and nothing but the free span tells.
SAME, LANDING = 0.45, 0.8
# Cable that may be clamped behind P0 [rad].
TAIL = 0.6


def number_turns(
    found: FloatArray,
    *,
    angle: float,
    turns: TurnMap,
    slope: float,
    diameter: float,
    onward: float,
    landing: float,
    farthest: float,
) -> dict[int, int]:
    """Return the whole turns that lie between each sighting and the contact line.

    A sighting at azimuth a whose number is m was wound at the angle `angle` - a - 2 pi m.

    Args:
        found: Turns of a row, see `turns_in_row`.
        angle: Azimuth of P0, whole turns included [rad].
        turns: What is known.
        slope: dz/dtheta of the newest turn [m/rad].
        diameter: Of the cable [m].
        onward: See `LayConfig`, dimensionless.
        landing: z where the cable lands [m], nan if unknown.
        farthest: Way along the winding beyond which there is no cable [m].

    Returns:
        Index in `found` -> number m.
    """
    if not len(found):
        return {}
    # A row stands at nearly the same azimuth everywhere.
    azimuth = float(np.median(found[:, PLACE]))
    front = angle - azimuth
    pairs, unknown = [], []
    for m in range(max(math.floor((front + TAIL) / TURN) + 1, 0)):
        expected, limit = turns.near(front - TURN * m, REACH, slope), SAME * diameter
        if math.isnan(expected) and m == 0 and math.isfinite(landing):
            expected, limit = landing - slope * azimuth, LANDING * diameter
        if math.isnan(expected):
            unknown.append(m)
            continue
        misses = np.abs(found[:, Z] - expected)
        pairs += [(m, float(misses[k]), int(k)) for k in np.flatnonzero(misses < limit)]
    numbers: dict[int, int] = {}
    # Where turns lie on each other the newest is on top: it takes what is seen whole.
    for m, miss, index in sorted(pairs):
        if index in numbers or m in numbers.values():
            continue
        rivals = [pair for pair in pairs if pair[2] == index and pair[0] > m]
        if found[index, KIND] == WHOLE or not any(pair[1] < miss for pair in rivals):
            numbers[index] = m
    if unknown:
        sure = math.floor(front / TURN) + 1
        newest = max((onward * found[k, Z] for k in numbers), default=farthest)
        left = [
            k
            for k in range(len(found))
            if k not in numbers
            and found[k, KIND] == WHOLE
            and -diameter < onward * found[k, Z] < min(newest, farthest)
        ]
        # By their order along the cylinder, if as many are left as there must be. How long the tail
        # behind P0 is nobody knows.
        if sum(m < sure for m in unknown) <= len(left) <= len(unknown):
            left.sort(key=lambda k: -onward * float(found[k, Z]))
            numbers.update(zip(left, unknown, strict=False))
    return numbers
