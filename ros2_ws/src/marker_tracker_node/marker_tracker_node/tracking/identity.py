"""Which of the bands that move with the cylinder is P0: the joint likelihood of all of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from marker_tracker_node.arrays import FlagArray, FloatArray, IndexArray
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.fit import SURE
from marker_tracker_node.tracking.estimator.numbers import NUMBERS, PLACE, TILT, ZERO
from marker_tracker_node.tracking.estimator.verdict import AS_WELL, LEAST_ALONE
from marker_tracker_node.tracking.frame.laid_path import (
    BAND_REACH,
    FARTHEST,
    GAP_SIGMA,
    LAY_SIGMA,
    OFFSET_SIGMA,
    SAME_ANGLE,
    SAME_HEIGHT,
)
from marker_tracker_node.tracking.p0_search import MovingBand
from marker_tracker_node.tracking.state import PATH_STEP, Marks

# Offsets of the guide that are tried [m], and ratios of the gaps to the expected one: to twice
# what is set, and a half; so finely that the nearest one is a deviation off at most.
_FAR = math.ceil(FARTHEST * OFFSET_SIGMA / SAME_HEIGHT)
_OFFSETS = SAME_HEIGHT * np.arange(-_FAR, _FAR + 1.0)[:, None, None, None]
_DOUBLE = math.ceil(2.0 * math.log(2.0) / GAP_SIGMA)
_RATIOS = np.exp(0.5 * GAP_SIGMA * np.arange(-_DOUBLE, _DOUBLE + 1.0))[:, None, None]

# Gives z of the laid cable, see `Tracks.paths` [m], where the encoder reads so at P0 [rad].
Paths = Callable[[float], FloatArray]


@dataclass(frozen=True, kw_only=True)
class Identified:
    """Which markers bands are.

    Attributes:
        numbers: Of the markers, P0 first, -1 where it is ambiguous, shape (k,).
    """

    bands: tuple[MovingBand, ...]  # Of the markers, shape (k,)
    numbers: IndexArray
    theta: FloatArray  # Their wound angles from P0 [rad], shape (k,)
    z: FloatArray  # Their z from P0 [m], shape (k,)
    offset: float  # Of the guide, see `Guide` [m]
    cost: float  # Twice the negative logarithm of the likelihood

    @property
    def first(self) -> MovingBand:
        """P0."""
        return self.bands[0]

    def agrees(self, phase: float, marks: Marks) -> bool:
        """Return whether the known markers are the same bands; P0 is one of them.

        The phase is the azimuth of P0 less the encoder's reading [rad].
        """
        for n in np.flatnonzero(marks.known).tolist():
            aside = [
                abs(math.remainder(phase - marks.theta[n] - band.offset, math.tau)) / SAME_ANGLE
                + abs(marks.height[n] - band.z) / SAME_HEIGHT
                for band in self.bands
            ]
            nearest = int(np.argmin(aside))
            same = self.numbers[nearest] == n
            if n in self.numbers and not (
                same and abs(marks.theta[n] - self.theta[nearest]) < math.pi
            ):
                return False
        return bool(marks.known[0])


def identified(
    bands: list[MovingBand],
    config: TrackerConfig,
    paths: Paths,
    origins: Callable[[MovingBand], float],
    readings: tuple[float, float],
    distance: float,
) -> Identified | None:
    """Return which band is P0; None while two may be it.

    Encoder readings at P0 are those of `origins`; `readings` are that with which bands were looked
    for first, and that where P0 lands as configured [rad]. The camera is at a distance [m].
    """
    newest = max((band.last for band in bands), default=0.0)
    # One that comes round at another offset, as the encoder's scale is wrong, is the same band.
    bands = [
        _seen_since(band, bands) for band in bands if newest - band.last < math.tau - BAND_REACH
    ]
    found = []
    for band in bands:
        origin = origins(band)
        by_guide, by_feed = (
            _explained(band, bands, config, path, (origin, *readings), distance)
            for path in paths(origin)
        )
        by_feed = replace(by_feed, offset=0.0, cost=by_feed.cost + SURE**2)
        found.append(min(by_guide, by_feed, key=lambda one: one.cost))
    found.sort(key=lambda one: one.cost)
    # A band that is alone is P0 where that lies as it should.
    rival = found[1].cost - AS_WELL if len(found) > 1 else SURE**2
    return found[0] if found and found[0].cost < rival else None


def _seen_since(band: MovingBand, bands: list[MovingBand]) -> MovingBand:
    """Return a band as first seen where it is one of the bands, which came round elsewhere."""
    earlier = [
        other.first
        for other in bands
        if other.last < band.first
        and abs(other.z - band.z) < SAME_HEIGHT
        and abs(math.remainder(other.offset - band.offset, math.tau)) < BAND_REACH
    ]
    return replace(band, first=min(earlier)) if earlier else band


def _explained(
    first: MovingBand,
    bands: list[MovingBand],
    config: TrackerConfig,
    path: FloatArray,
    readings: tuple[float, float, float],
    distance: float,
) -> Identified:
    """Explain all bands with one of them as P0."""
    cost = _unlike_configured(first, config, readings, distance)
    others = [band for band in bands if band is not first]
    if not others:
        none = np.zeros(1)
        return Identified(
            bands=(first,), numbers=none.astype(int), theta=none, z=none, offset=0.0, cost=cost
        )
    z = np.array([band.z - first.z for band in others])
    theta, possible = _wound(first, others, readings)
    gap = config.expected_gap * _RATIOS
    number = np.clip(np.round(theta / gap), 1, config.marker_count).astype(int)
    away = (theta - number * gap) / (SAME_ANGLE * np.sqrt(number))
    off = _off_path(z[:, None], theta, config, path) / LAY_SIGMA
    square = np.where(possible, away**2 + off**2, math.inf)
    best = square.argmin(axis=-1)
    own = np.minimum(square.min(axis=-1), LEAST_ALONE)
    numbers = np.take_along_axis(np.broadcast_to(number, square.shape), best[..., None], -1)[..., 0]
    # Of two bands with one number the second is not explained.
    for i in range(1, len(others)):
        twice = (numbers[..., :i] == numbers[..., i : i + 1]) & (own[..., :i] < LEAST_ALONE)
        own[..., i] = np.where(twice.any(axis=-1), LEAST_ALONE, own[..., i])
    # And markers that were passed over should have been seen.
    clear = own < LEAST_ALONE
    passed = np.where(clear, numbers, 0).max(axis=-1) - clear.sum(axis=-1)
    doubted = _tail(_OFFSETS / OFFSET_SIGMA) + _tail(np.log(_RATIOS) / GAP_SIGMA)
    total = doubted[..., 0, 0] + own.sum(axis=-1) + SURE**2 * passed
    at = np.unravel_index(int(total.argmin()), total.shape)
    # Other numbers of the same bands may explain them as well: then P0 alone is known.
    other = total[(numbers != numbers[at]).any(axis=-1)]
    sure = other.min(initial=math.inf) - total[at] > AS_WELL
    clear = clear[at]
    places = theta[np.arange(len(others)), best[at]]
    return Identified(
        bands=(first, *(band for band, one in zip(others, clear, strict=True) if one)),
        numbers=np.append(0, np.where(sure, numbers[at][clear], -1)),
        theta=np.append(0.0, places[clear]),
        z=np.append(0.0, z[clear]),
        offset=float(_OFFSETS[at[0], 0, 0, 0]),
        cost=cost + float(total[at]),
    )


def _unlike_configured(
    first: MovingBand,
    config: TrackerConfig,
    readings: tuple[float, float, float],
    distance: float,
) -> float:
    """Return what it costs that P0 is not where encoder and camera, as configured, have it."""
    origin, _, configured = readings
    place = math.hypot(NUMBERS[PLACE + 1].doubt, NUMBERS[TILT].doubt * distance)
    angle = math.hypot(NUMBERS[ZERO].doubt, place / config.centreline_radius)
    zero = math.remainder(origin - configured, math.tau) / angle
    return min(float(_tail(zero)), AS_WELL) + float(_tail(first.z / place))


def _wound(
    first: MovingBand, others: list[MovingBand], readings: tuple[float, float, float]
) -> tuple[FloatArray, FlagArray]:
    """Return wound angles of bands [rad] by the turns between, and whether each is possible.

    A band had landed when it was seen first, and not before the lap in which it would have been
    seen as it landed. Both have the shape (bands, turns).
    """
    origin, begun, _ = readings
    seen = np.array([band.first for band in others])[:, None] - origin
    turns = math.tau * np.arange(max(int(seen.max() / math.tau) + 2, 1))
    theta = np.array([(first.offset - band.offset) % math.tau for band in others])[:, None] + turns
    new = seen - math.tau > begun - origin + BAND_REACH
    return theta, (theta < seen + BAND_REACH) & ~(new & (theta < seen - math.pi))


def _off_path(
    z: FloatArray, theta: FloatArray, config: TrackerConfig, path: FloatArray
) -> FloatArray:
    """Return how far z lies off a path, and what its first turn may hold it off, by offset [m]."""
    share = replace(config.law, advance_per_radian=1.0).slope
    grid = PATH_STEP * np.arange(path.size)
    turn = np.interp(math.tau, grid, path) + _OFFSETS * share(math.tau)
    held = np.copysign(np.maximum(2.0 * config.cable_radius - np.abs(turn), 0.0), turn)
    off = z - np.interp(theta, grid, path) - _OFFSETS * share(theta)
    return np.asarray(off - np.clip(off, np.minimum(held, 0.0), np.maximum(held, 0.0)))


def _tail(off: FloatArray | float) -> FloatArray:
    """Return the cost of what is so many deviations off, of a distribution with heavy tails."""
    return SURE**2 * np.log1p(np.square(off) / SURE**2)
