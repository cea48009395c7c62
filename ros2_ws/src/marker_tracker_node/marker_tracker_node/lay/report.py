"""What is known of a lay: its turns place by place, and where something is wrong with them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import LayConfig
from marker_tracker_node.lay.free_span import FreeSpan
from marker_tracker_node.lay.turn_map import BEFORE, PLACE_ANGLE, PLACES_PER_TURN, TurnMap
from winding_core.lay_records import LAY_DTYPE, LayFlag, LayRecords

FloatArray = NDArray[np.float64]

# Flags over fewer places than this are not told as a defect, and pauses of as many are part of one.
SHORTEST, LONGEST_PAUSE = 3, 3
LIFT_DOUBT = 0.3


@dataclass(frozen=True, kw_only=True)
class LayDefect:
    """A stretch of cable that does not lie as it should.

    Attributes:
        flag: What is wrong.
        first: Wound angle at which it begins [rad].
        last: Wound angle at which it ends [rad].
    """

    flag: LayFlag
    first: float
    last: float


@dataclass(frozen=True, kw_only=True)
class LayReport:
    """The lay as far as it was seen.

    Attributes:
        records: Of LAY_DTYPE, by rising wound angle.
        defects: Gaps, overlaps and climbs, by rising wound angle.
        span: The free span, None where it was not seen lately.
        free_length: From angles and guide places so far [m], nan while unknown.
        sigma_free_length: One standard deviation [m].
    """

    records: LayRecords
    defects: tuple[LayDefect, ...]
    span: FreeSpan | None
    free_length: float
    sigma_free_length: float


def lay_records(config: LayConfig, turns: TurnMap, angle: float) -> LayRecords:
    """Return a record for every place that was seen, by rising wound angle.

    Args:
        config: Machine and limits.
        turns: What was seen.
        angle: Azimuth of P0 at the records' time, whole turns included [rad].
    """
    seen = np.flatnonzero(turns.count[BEFORE:] > 0) + BEFORE
    z, lift, pitch, flags = _judged(config, turns)
    records = np.zeros(seen.size, dtype=LAY_DTYPE)
    theta = (seen - BEFORE + 0.5) * PLACE_ANGLE
    azimuth = angle - theta
    radius = config.rho + lift[seen]
    records["x"] = radius * np.cos(azimuth)
    records["y"] = radius * np.sin(azimuth)
    records["z"] = z[seen]
    records["turn"] = (seen - BEFORE) // PLACES_PER_TURN
    records["theta"] = theta
    # A soft cable may be pressed flat where it is thought to lie higher.
    doubt = LIFT_DOUBT * lift[seen] * np.abs(turns.steep[seen])
    scatter = 1.0 / np.sqrt(turns.weight[seen])
    records["sigma_z"] = np.sqrt(scatter**2 + turns.floor[seen] ** 2 + doubt**2)
    records["pitch"] = pitch[seen]
    records["lift"] = lift[seen]
    records["flags"] = flags[seen]
    return records


def _judged(
    config: LayConfig, turns: TurnMap
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.uint32]]:
    """Return z and lift [m], pitch [m] and flags of every place."""
    size, d, onward = turns.z.size, config.diameter, config.onward
    z, lift = turns.z.copy(), np.zeros(size)
    pitch, flags = np.full(size, np.nan), np.zeros(size, dtype=np.uint32)
    meant = max(2.0 * math.pi * abs(config.advance_per_radian), d)
    for place in np.flatnonzero(turns.count > 0):
        under = np.arange(place - PLACES_PER_TURN, -1, -PLACES_PER_TURN)
        if not under.size or not turns.count[under[0]]:
            continue
        under = under[turns.count[under] > 0]
        pitch[place] = z[place] - z[under[0]]
        ahead = onward * z[place] - (onward * z[under]).max()
        if ahead > meant + config.gap_limit * d:
            flags[place] |= LayFlag.GAP
        elif ahead < config.overlap_limit * d and turns.whole[place] > 0.5:
            climbs = ahead < config.climb_limit * d
            flags[place] |= LayFlag.CLIMB if climbs else LayFlag.OVERLAP
            for _ in range(2):
                beside = np.minimum(np.abs(z[place] - z[under]), d)
                height = lift[under] + np.sqrt(d * d - beside * beside)
                lift[place] = float(np.where(beside < d, height, 0.0).max())
                z[place] = turns.z[place] - lift[place] * turns.steep[place]
            pitch[place] = z[place] - z[under[0]]
    return z, lift, pitch, flags


def defects_of(records: LayRecords) -> Iterator[LayDefect]:
    """Yield the stretches of records that bear a flag."""
    for flag in (LayFlag.GAP, LayFlag.OVERLAP, LayFlag.CLIMB):
        marked = np.flatnonzero(records["flags"] & flag)
        if not marked.size:
            continue
        way = np.diff(records["theta"][marked])
        for part in np.split(marked, np.flatnonzero(way > (LONGEST_PAUSE + 0.5) * PLACE_ANGLE) + 1):
            if part.size >= SHORTEST:
                first, last = records["theta"][part[0]], records["theta"][part[-1]]
                yield LayDefect(
                    flag=flag,
                    first=float(first) - 0.5 * PLACE_ANGLE,
                    last=float(last) + 0.5 * PLACE_ANGLE,
                )
