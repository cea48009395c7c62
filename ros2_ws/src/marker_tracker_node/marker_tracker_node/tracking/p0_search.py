"""P0 in a picture: its colour where it must stand, and its band where it may pass."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import cv2
import numpy as np

from marker_tracker_node.arrays import ByteArray, FlagArray
from marker_tracker_node.camera.pinhole import plane_of_pixel
from marker_tracker_node.detection.band import Band, band_centroid, section_at, solve_band
from marker_tracker_node.detection.colour import (
    ColourModel,
    ColourRefusedError,
    colour_index,
    hue_region,
)
from marker_tracker_node.detection.gate import empty_gates
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.numbers import NUMBERS, PLACE
from marker_tracker_node.tracking.estimator.verdict import SIGNIFICANT
from marker_tracker_node.tracking.frame.gate_prediction import axis_scale, predict_gate
from marker_tracker_node.tracking.frame.laid_path import (
    BAND_REACH,
    PROOF_ADVANCE,
    PROOF_HITS,
    SAME_ANGLE,
    SAME_HEIGHT,
    USUAL_SCALE,
)
from marker_tracker_node.tracking.state import CANDIDATES, Setup

# How far P0 may appear from its place before the camera's pose was ever refined [m]: as far as one
# that was set with a tape measure stands off.
SEARCH_REACH = SIGNIFICANT * NUMBERS[PLACE + 1].doubt
SATURATIONS = np.arange(0.45, 0.95, 0.05)
# A band is whole enough to be recognised by its colour.
WHOLE_ENOUGH = 0.5
# Share by which the pixels of its hue may be fewer or more than its band should fill.
AREA_RANGE = 0.7


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where P0 should appear."""

    column: float  # Of its band's centroid [px]
    row: float  # Of its band's centroid [px]
    reach: float  # How far from there it may be [px]
    pixels: float  # That its band should fill

    @classmethod
    def predicted(cls, setup: Setup, azimuth: float, z: float = 0.0) -> _Place:
        """Return the place of P0 at an azimuth and z."""
        gates = empty_gates(1)
        pixels = predict_gate(setup, Band(azimuth=azimuth, z=z, slope=0.0), gates, 0)
        (column,), (row,), (ahead,) = gates.column, gates.row, gates.ahead
        return cls(
            column=column,
            row=row,
            reach=ahead + SEARCH_REACH * axis_scale(setup.camera),
            pixels=pixels,
        )

    def window(self, frame: ByteArray, reach: float) -> tuple[slice, slice]:
        """Return the rows and columns of a frame within a distance [px]."""
        rows, columns = frame.shape[:2]
        top, bottom = int(self.row - reach), int(self.row + reach) + 1
        left, right = int(self.column - reach), int(self.column + reach) + 1
        return slice(max(top, 0), min(bottom, rows)), slice(max(left, 0), min(right, columns))


def sample_colour(
    frame: ByteArray, config: TrackerConfig, setup: Setup, angle: float
) -> ColourModel:
    """Learn the colour from P0, which stands at azimuth `angle` [rad] and z = 0 in a frame.

    Raises:
        ColourRefusedError: P0 is not there, or its pixels define no colour.
    """
    if abs(angle) > BAND_REACH:
        raise ColourRefusedError(
            f"P0 can be sampled within {BAND_REACH} rad of the start only, the cylinder is at "
            f"{angle:.2f} rad"
        )
    place = _Place.predicted(setup, angle)
    inner, expected = place.window(frame, place.reach), place.pixels
    patch = frame[inner]
    index = colour_index(patch)
    for saturation in SATURATIONS:
        prior = hue_region(config.marker_hue, config.marker_hue_tolerance, saturation)
        blob = _largest_blob(prior[index])
        # A cylinder of brass has the marker's hue and merges with it until only the marker is
        # saturated enough.
        if blob.sum() < (1.0 + AREA_RANGE) * expected:
            break
    if abs(blob.sum() - expected) > AREA_RANGE * expected:
        raise ColourRefusedError(
            f"P0 is not where it should be: {int(blob.sum())} pixels of its hue instead of "
            f"{expected:.0f}"
        )
    core = cv2.erode(blob, np.ones((3, 3), np.uint8), borderValue=0).astype(bool)
    if core.sum() < (1.0 - AREA_RANGE) * expected:
        core = blob.astype(bool)
    _, wide = place.window(frame, 2.0 * place.reach)
    outside = np.ones(frame.shape[:2], dtype=bool)
    outside[inner] = cv2.dilate(blob, np.ones((7, 7), np.uint8)) == 0
    # Markers on the free span stand above P0 and are no background.
    outside[: inner[0].start, wide] = False
    return ColourModel.from_samples(patch[core], frame[outside])


def locate_marker(
    frame: ByteArray, colour: ColourModel, setup: Setup, angle: float, area: tuple[float, float]
) -> tuple[float, float]:
    """Return where P0's band appears near its place at azimuth `angle` [rad], z = 0 [px].

    Area is the least and the most accepted share of the pixels that it should fill.

    Raises:
        ColourRefusedError: Nothing of its size is there.
    """
    place = _Place.predicted(setup, angle)
    inner, expected = place.window(frame, place.reach), place.pixels
    blob = _largest_blob(colour.mask(frame[inner]))
    if not area[0] * expected <= blob.sum() <= area[1] * expected:
        raise ColourRefusedError(
            f"P0 is not where it should be: {int(blob.sum())} pixels of its colour instead of "
            f"{expected:.0f}"
        )
    rows, columns = np.nonzero(blob)
    return float(columns.mean() + inner[1].start), float(rows.mean() + inner[0].start)


def _largest_blob(mask: FlagArray) -> ByteArray:
    blank = np.zeros(mask.shape, np.uint8)
    if not mask.any():
        return blank
    _, labels, stats, _ = cv2.connectedComponentsWithStats(blank + mask, connectivity=4)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(labels == largest, dtype=np.uint8)


@dataclass(kw_only=True)
class MovingBand:
    """Something of the marker's hue that may move with the cylinder."""

    offset: float  # Its azimuth less the encoder's angle [rad], within half a turn of zero
    z: float  # As seen [m]
    first: float  # Encoder angle when it was seen first [rad]
    last: float  # The same when it was seen last [rad]
    sightings: int = 1  # How often it was seen
    samples: list[ByteArray] = field(default_factory=list)  # Pixels of it, blue-green-red
    # Encoder angle, azimuth [rad] and z [m] of its sightings in a turn.
    path: list[tuple[float, float, float]] = field(default_factory=list)

    @property
    def moving(self) -> bool:
        """Whether it has moved with the cylinder so far."""
        return self.sightings > 1 and abs(self.last - self.first) > SAME_ANGLE

    @property
    def proven(self) -> bool:
        """Whether it moves with the cylinder."""
        moved = abs(self.last - self.first)
        # Markers, which are expected, need one sighting less; few frames a turn show fewer.
        return self.sightings > PROOF_HITS and moved >= PROOF_ADVANCE

    @property
    def arc(self) -> float:
        """Over how much of the last turn it was seen [rad]."""
        return float(np.ptp([angle for angle, _, _ in self.path]))

    def height(self, setup: Setup, origin: float) -> tuple[float, float]:
        """Return which height of the camera explains its place [m], and how much better.

        That is the scatter of its place on the cylinder as the camera is configured, over that as
        seen from elsewhere; the encoder reads `origin` [rad] where P0 lands. Seen from another
        height it seems to move at another speed, and with another zero it does not.
        """
        view, body = setup.camera, setup.body
        path = [
            (Band(azimuth, z, 0.0), Band(math.remainder(angle - origin, math.tau), 0.0, 0.0))
            for angle, azimuth, z in self.path
        ]
        rise = [[section_at(body.rho, band.azimuth, 0.0).y for band in pair] for pair in path]
        height = -float(np.diff(rise).mean())
        moved = view._replace(y=view.y - height)
        as_zero = np.unwrap([seen.azimuth - true.azimuth for seen, true in path])
        as_height = [
            solve_band(moved, body, *band_centroid(view, body, seen)[:2], true)[0] - true.azimuth
            for seen, true in path
        ]
        return height, float(np.std(as_zero) / np.std(as_height))


class BandSearch:
    """Follows what has the hue of a marker and lies where P0 passes, until it is P0."""

    def __init__(self, config: TrackerConfig, reach: float = SEARCH_REACH) -> None:
        """Start with nothing seen; bands are looked for within a reach along the cylinder [m]."""
        self._config, self._reach = config, reach
        self._passing: list[MovingBand] = []
        self._begun = self._angle = math.nan
        # Nearer to P0's place than to that of P1 on its first turn.
        self._surely = 0.5 * float(config.law.z(config.expected_gap))

    def add(self, frame: ByteArray, setup: Setup, angle: float) -> None:
        """Take a frame of shape (rows, columns, 3), at a reading of the encoder [rad]."""
        if math.isnan(self._begun):
            self._begun = angle
        self._angle = angle
        for azimuth, z, samples in bands_of_hue(frame, self._config, setup, self._reach):
            self._take(angle, azimuth, z, samples)

    @property
    def proven(self) -> list[MovingBand]:
        """Bands that move with the cylinder."""
        return [band for band in self._passing if band.proven]

    @property
    def first(self) -> MovingBand | None:
        """P0, once it is known which of the bands it is."""
        lowest = min(self.proven, key=lambda band: band.z, default=None)
        if lowest is None or abs(self._angle - self._begun) > math.tau:
            return lowest
        # One that is not proven yet may be P0 as well.
        lower = any(band.moving and band.z < lowest.z for band in self._passing)
        return lowest if abs(lowest.z) < self._surely and not lower else None

    @property
    def moving(self) -> bool:
        """Whether something of the marker's hue has moved with the cylinder so far."""
        return any(band.moving for band in self._passing)

    def _take(self, angle: float, azimuth: float, z: float, samples: ByteArray) -> None:
        offset = math.remainder(azimuth - angle, math.tau)
        for band in self._passing:
            off = math.remainder(offset - band.offset, math.tau)
            if abs(off) < SAME_ANGLE and abs(z - band.z) < SAME_HEIGHT:
                band.sightings += 1
                share = 1.0 / band.sightings
                band.offset = math.remainder(band.offset + share * off, math.tau)
                band.z += share * (z - band.z)
                band.last = angle
                newest = [seen for seen in band.path if abs(angle - seen[0]) < math.tau]
                band.path = [*newest, (angle, azimuth, z)]
                band.samples = [*band.samples[-3:], samples]
                return
        recent = sorted(self._passing, key=lambda band: band.sightings)[1 - CANDIDATES :]
        new = MovingBand(offset=offset, z=z, first=angle, last=angle, samples=[samples])
        new.path.append((angle, azimuth, z))
        self._passing = [*recent, new]


def bands_of_hue(
    frame: ByteArray, config: TrackerConfig, setup: Setup, along: float
) -> list[tuple[float, float, ByteArray]]:
    """Return azimuth [rad], z [m] and pixels of what looks like P0 anywhere in its pass.

    It may be beside its place by so much along the cylinder [m]. Bands of later turns may touch
    that of P0 on the +z side: the first cable's width counts.
    """
    place, scale = _Place.predicted(setup, 0.0), axis_scale(setup.camera)
    wide = 2.0 * config.cable_radius * scale
    reach = 0.5 * wide + along * scale
    left = max(int(place.column - reach), 0)
    right = int(place.column + reach) + 1
    strip = frame[:, left:right]
    if not strip.size:
        return []
    index = colour_index(strip)
    for saturation in SATURATIONS:
        mask = hue_region(config.marker_hue, config.marker_hue_tolerance, saturation)[index]
        found = [
            one
            for one in _bands(mask, strip, left, wide, place.pixels, setup)
            if abs(one[1]) <= along
        ]
        if found:
            return found
    return []


def _bands(
    mask: FlagArray, strip: ByteArray, left: int, wide: float, area: float, setup: Setup
) -> list[tuple[float, float, ByteArray]]:
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask.astype(np.uint8), connectivity=4
    )
    found = []
    for label in range(1, count):
        first, across = (int(stats[label, kind]) for kind in (cv2.CC_STAT_LEFT, cv2.CC_STAT_WIDTH))
        parts = [labels == label]
        if across > USUAL_SCALE * wide:
            # Bands of turns that touch: the first one, and the last. What does not begin with a
            # band, such as a cylinder of that hue, ends with none.
            parts = [parts[0], parts[0].copy()]
            parts[0][:, first + round(wide) :] = False
            parts[1][:, : first + across - round(wide)] = False
        for part in parts:
            place = _place(part, left, area, setup)
            if place is None:
                break
            found.append((*place, strip[part]))
    return found


def _place(part: FlagArray, left: int, area: float, setup: Setup) -> tuple[float, float] | None:
    """Return azimuth [rad] and z [m] of a part of a strip; None if it is no band of a marker."""
    size = int(part.sum())
    # Seen from the side a band is shorter.
    if not 0.5 * WHOLE_ENOUGH * area <= size <= (1.0 + AREA_RANGE) * area:
        return None
    rows, columns = np.nonzero(part)
    if rows.min() == 0 or rows.max() == len(part) - 1:
        return None
    a, b = plane_of_pixel(setup.camera, float(columns.mean()) + left, float(rows.mean()))
    # What stands before the contact line may be cable that is not wound yet.
    azimuth, z = solve_band(setup.camera, setup.body, a, b, Band(azimuth=0.5, z=0.0, slope=0.0))
    if not -0.5 * BAND_REACH <= azimuth <= setup.usable_azimuth:
        return None
    expected = _Place.predicted(setup, azimuth, z).pixels
    whole = WHOLE_ENOUGH * expected <= size <= (1.0 + AREA_RANGE) * expected
    return (azimuth, z) if whole else None
