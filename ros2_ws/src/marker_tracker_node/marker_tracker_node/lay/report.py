"""What is known of a lay: its turns place by place, and where something is wrong with them."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import LayConfig
from marker_tracker_node.lay.free_span import FreeSpan
from marker_tracker_node.lay.turn_map import BEFORE, PLACE_ANGLE, PLACES_PER_TURN, TurnMap
from winding_core.lay.records import LAY_DTYPE, LayFlag, LayRecords

FloatArray = NDArray[np.float64]

# Flags over fewer places than this are no defect, and pauses of as many are part of one.
SHORTEST, LONGEST_PAUSE = 3, 3
LIFT_DOUBT = 0.3
DEEPEST = 12  # A turn lies on one of so many before it


@dataclass(frozen=True, kw_only=True)
class LayDefect:
    """A stretch of cable that does not lie as it should."""

    flag: LayFlag  # What is wrong
    first: float  # Wound angle at which it begins [rad]
    last: float  # Wound angle at which it ends [rad]


@dataclass(frozen=True, kw_only=True)
class LayReport:
    """The lay as far as it was seen."""

    records: LayRecords  # Of LAY_DTYPE, by rising wound angle
    defects: tuple[LayDefect, ...]  # Gaps, overlaps and climbs, by rising wound angle
    span: FreeSpan | None  # The free span, None where it was not seen lately
    free_length: float  # From angles and guide places so far [m], nan while unknown
    sigma_free_length: float  # One standard deviation [m]


def lay_records(
    config: LayConfig,
    turns: TurnMap,
    angle: float,
    newest: int | None = None,
    pose_sigma: Callable[[FloatArray], FloatArray] | None = None,
) -> LayRecords:
    """Return a record for every place that was seen, by rising wound angle.

    Args:
        config: Machine and limits.
        turns: What was seen.
        angle: Azimuth of P0 at the records' time, whole turns included [rad].
        newest: Turns at the end that are returned, None for all.
        pose_sigma: Standard deviation [m] of z [m] that the camera's pose leaves, None for none.
    """
    seen = np.flatnonzero(turns.places.sightings[BEFORE:] > 0) + BEFORE
    if newest is not None and seen.size:
        seen = seen[seen > seen[-1] - newest * PLACES_PER_TURN]
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
    doubt = LIFT_DOUBT * lift[seen] * np.abs(turns.places.steep[seen])
    # What rows are off each other counts beside what they state, as of a mean of so many.
    scatter = turns.places.spread[seen] / max(config.azimuths - 1, 1)
    scatter += 1.0 / turns.places.weight[seen]
    posed = 0.0 if pose_sigma is None else pose_sigma(z[seen])
    records["sigma_z"] = np.sqrt(scatter + turns.places.floor[seen] ** 2 + doubt**2 + posed**2)
    records["pitch"] = pitch[seen]
    records["lift"] = lift[seen]
    records["flags"] = flags[seen]
    return records


def _judged(
    config: LayConfig, turns: TurnMap
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.uint32]]:
    """Return z and lift [m], pitch [m] and flags of every place."""
    d, onward = config.diameter, config.onward
    meant = max(2.0 * math.pi * abs(config.advance_per_radian), d)
    # Whole turns as rows, from half a turn before P0: what lies over each other stands in a column.
    shape = (-1, PLACES_PER_TURN)
    seen, whole = (
        (turns.places.sightings > 0).reshape(shape),
        turns.places.whole.reshape(shape) > 0.5,
    )
    plain, steep = turns.places.z.reshape(shape), turns.places.steep.reshape(shape)
    z, lift = plain.copy(), np.zeros(plain.shape)
    pitch, flags = np.full(plain.shape, np.nan), np.zeros(plain.shape, dtype=np.uint32)
    rows = np.flatnonzero(seen.any(axis=1))
    farthest = np.full(PLACES_PER_TURN, -np.inf)
    for k in range(int(rows[-1]) + 1 if rows.size else 0):
        if k:
            ahead = onward * z[k] - farthest
            judged = seen[k] & seen[k - 1]
            flags[k] = np.where(judged & (ahead > meant + config.gap_limit * d), LayFlag.GAP, 0)
            over = judged & whole[k] & (ahead < config.overlap_limit * d)
            under = slice(max(k - DEEPEST, 0), k)
            for _ in range(2 if over.any() else 0):
                beside = np.where(seen[under], np.abs(z[k] - z[under]), np.inf)
                height = lift[under] + np.sqrt(np.maximum(d * d - beside * beside, 0.0))
                lift[k] = np.where(over, np.where(beside < d, height, 0.0).max(axis=0), 0.0)
                z[k] = plain[k] - lift[k] * steep[k]
            # What lies higher looks farther from the middle of the picture than it is.
            climbs = over & (onward * z[k] - farthest < config.climb_limit * d)
            flags[k] |= np.where(climbs, LayFlag.CLIMB, np.where(over, LayFlag.OVERLAP, 0)).astype(
                np.uint32
            )
            pitch[k] = np.where(judged, z[k] - z[k - 1], np.nan)
        farthest = np.where(seen[k], np.maximum(farthest, onward * z[k]), farthest)
    return z.ravel(), lift.ravel(), pitch.ravel(), flags.ravel()


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
