"""Markers that pass before the camera: how fast they move over the picture, when they return."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.evidence import SightingLog

FloatArray = NDArray[np.float64]

TURN = 2.0 * math.pi
# Bands beyond this azimuth are seen from the side [rad]; a passing that is shorter tells little.
_FACING, _LEAST_SPAN, _LEAST_ROWS = 1.0, 0.1, 4
# Laps of a marker that are judged: what a long run costs does not grow with it.
_FIRST_LAPS, _NEWEST_LAPS = 2, 6
# Times that are more wrong than this are not looked for; so many steps on either side.
_MOST_STRETCH, _STRETCHES = 0.25, 50


@dataclass(frozen=True, kw_only=True)
class Passing:
    """A marker before the camera once."""

    marker: int  # Its number
    lap: int  # Which passing
    azimuth: FloatArray  # Of the sightings, less their mean [rad]
    angle: FloatArray  # Of the encoder then, less its mean [rad]
    t: FloatArray  # [s]
    ahead: float  # Encoder angle at which the marker stood at azimuth zero [rad]


def passings_of(log: SightingLog) -> list[Passing]:
    """Return the first and the newest passings that were seen long enough, marker by marker."""
    rows = log.sightings[np.abs(log.sightings[:, 4]) < _FACING]
    found = []
    for marker in np.unique(rows[:, 0]).astype(int).tolist():
        seen = rows[rows[:, 0] == marker]
        laps = np.unique(seen[:, 1]).astype(int).tolist()
        for lap in sorted({*laps[:_FIRST_LAPS], *laps[-_NEWEST_LAPS:]}):
            own = seen[seen[:, 1] == lap]
            azimuth, angle = own[:, 4], own[:, 3]
            if azimuth.size < _LEAST_ROWS or np.ptp(azimuth) < _LEAST_SPAN:
                continue
            slope = float(np.polyfit(azimuth, angle, 1)[0])
            found.append(
                Passing(
                    marker=marker,
                    lap=lap,
                    azimuth=azimuth - azimuth.mean(),
                    angle=angle - angle.mean(),
                    t=own[:, 2],
                    ahead=float(angle.mean() - slope * azimuth.mean()),
                )
            )
    return found


class Slope(NamedTuple):
    """One number that explains how bands move: its value, deviation, and what it leaves [rad]."""

    value: float
    sigma: float
    rest: float


def _slope(of: FloatArray, over: FloatArray) -> Slope:
    square = max(float(over @ over), 1.0e-12)
    value = float(of @ over) / square
    rest = float(np.sqrt(np.mean((of - value * over) ** 2)))
    return Slope(value, rest / math.sqrt(square), rest)


def motion_of(passings: list[Passing]) -> Slope | None:
    """Return by how much bands move over the picture per encoder angle; None if none was seen."""
    if not passings:
        return None
    return _slope(_columns(passings, "azimuth"), _columns(passings, "angle"))


def turns_left(pairs: FloatArray, motion: FloatArray, share: float) -> tuple[float, float]:
    """Return what a wrong scale, and what wrong times, leave of turns unexplained [rad rms].

    Args:
        pairs: Encoder angles at which markers stood ahead, and one turn later, shape (n, 2).
        motion: Shape (n, 2): t [s], angle [rad].
        share: By how much either is too large, relative (dimensionless).
    """
    when = np.interp(pairs, np.maximum.accumulate(motion[:, 1]), motion[:, 0])
    true = np.interp(when / (1.0 + share), motion[:, 0], motion[:, 1])
    by_angle = np.diff(pairs, axis=1) / (1.0 + share) - TURN
    by_time = np.diff(true, axis=1) - TURN
    return float(np.sqrt(np.mean(by_angle**2))), float(np.sqrt(np.mean(by_time**2)))


def stretched(passings: list[Passing], motion: FloatArray, usual: float) -> Slope:
    """Return how much too large the times would have to be, if that alone explains the motion.

    Args:
        passings: At least one.
        motion: Shape (n, 2): t [s], angle [rad].
        usual: How far bands seem to move where nothing is wrong, per angle (dimensionless).
    """

    def left(share: float) -> FloatArray:
        rest = []
        for one in passings:
            angle = np.interp(one.t / (1.0 + share), motion[:, 0], motion[:, 1])
            rest.append(one.azimuth / usual - angle + angle.mean())
        return np.concatenate(rest)

    shares = np.linspace(-_MOST_STRETCH, _MOST_STRETCH, 2 * _STRETCHES + 1)
    squares = [float((left(share) ** 2).sum()) for share in shares.tolist()]
    best = min(max(int(np.argmin(squares)), 1), shares.size - 2)
    low, middle, high = squares[best - 1 : best + 2]
    step, curve = shares[1] - shares[0], max(low - 2.0 * middle + high, 1.0e-12)
    value = float(shares[best] + 0.5 * step * (low - high) / curve)
    rest = float(np.sqrt(np.mean(left(value) ** 2)))
    return Slope(value, rest * step / math.sqrt(0.5 * curve), rest)


def _columns(passings: list[Passing], name: str) -> FloatArray:
    return np.concatenate([getattr(item, name) for item in passings])
