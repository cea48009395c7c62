"""Why P0 is not found where it must pass: wrong pictures, angles, or place of the camera.

Each reason is looked for by undoing it: then something moves with the cylinder as P0 does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import cv2
import numpy as np

from marker_tracker_node.arrays import ByteArray
from marker_tracker_node.detection.colour import ColourModel, hsv, hue_difference
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.frame.laid_path import BAND_REACH, LAY_SIGMA, LOOK_STEP
from marker_tracker_node.tracking.p0_search import (
    SATURATIONS,
    SEARCH_REACH,
    WHOLE_ENOUGH,
    BandSearch,
    MovingBand,
)
from marker_tracker_node.tracking.state import Setup
from winding_core.units import MILLIMETRE, MILLIRADIAN

# Pixels whose channels differ by less have no colour, and a picture with so few of others neither.
GREY_LEVELS = 24
COLOURED_SHARE = 2.0e-4
# Errors of the camera's height that are tried [m]: so far apart that P0 lies within the reach of a
# search with one of them. Along the axis P0 is sought as far.
STEP = 1.6 * SEARCH_REACH
HEIGHTS = (-2.0 * STEP, -STEP, STEP, 2.0 * STEP)
ALONG = HEIGHTS[-1] + SEARCH_REACH

_SWAPPED = (
    "the colours are swapped: P0 is found after exchanging red and blue; is it rgb8 labelled "
    "bgr8, or the other way round? Set encoding, or marker_hue if the markers are of that colour"
)
_DEGREES = "the encoder's readings are degrees instead of radians: P0 moves with a 57.3th of them"
_CHANGES: dict[str, Callable[[ByteArray], ByteArray]] = {
    "the picture is mirrored: P0 is found where it would be after exchanging left and right": (
        np.fliplr
    ),
    "the picture is upside down: P0 is found after turning it by half a turn": (
        lambda frame: np.fliplr(np.flipud(frame))
    ),
    "P0 moves against the cylinder: the picture is flipped, up for down, or the encoder counts "
    "backwards (cylinder_scale -1)": np.flipud,
    _SWAPPED: lambda frame: cv2.cvtColor(frame, cv2.COLOR_RGB2BGR),
    _DEGREES: lambda frame: frame,
}


class PictureDoubts:
    """Looks for P0 after undoing what a camera may do to pictures, or an encoder to angles."""

    def __init__(self, config: TrackerConfig) -> None:
        """Start with nothing seen."""
        self._last = math.nan
        # Exchanging red and blue leaves green what it was.
        swapped = math.remainder(240.0 - 2.0 * config.marker_hue, 360.0)
        alike = abs(swapped) <= 2.0 * config.marker_hue_tolerance
        self._searches = {
            sentence: BandSearch(config)
            for sentence in _CHANGES
            if not (alike and sentence == _SWAPPED)
        }

    def leaps(self, angle: float) -> bool:
        """Return whether the encoder's reading [rad] lies far from the one before.

        Readings that leap so far between frames may be degrees: a cylinder turns less.
        """
        return abs(angle - self._last) > BAND_REACH

    def add(self, frame: ByteArray, setup: Setup, angle: float) -> str:
        """Take a frame of shape (rows, columns, 3), at a reading of the encoder [rad].

        Return what is wrong with the pictures, empty while that is not known.
        """
        leaping = self.leaps(angle)
        self._last = angle
        for sentence, search in self._searches.items():
            if sentence is _DEGREES and not leaping:
                continue
            search.add(
                np.ascontiguousarray(_CHANGES[sentence](frame)),
                setup,
                math.radians(angle) if sentence is _DEGREES else angle,
            )
            if search.first is not None:
                return sentence
        return ""


class MisplacedCamera:
    """Looks for P0 as it would pass if the camera stood elsewhere than is configured.

    A camera that is wrong along the axis sees the same way of P0 elsewhere along it: one search
    that reaches farther finds it. Another height is another way, and a search of its own.

    Attributes:
        done: Whether P0 has passed often enough.
    """

    def __init__(self, config: TrackerConfig) -> None:
        """Start with nothing seen."""
        # The first marker lies lowest where the feed leads upwards.
        self.done = config.advance_per_radian <= 0.0
        self._gap = config.expected_gap
        # P0 has passed once after so much of the way; what is found earlier may be another marker.
        self._lap = math.tau + config.usable_azimuth
        self._along = BandSearch(config, ALONG)
        self._heights = {error: BandSearch(config) for error in HEIGHTS}
        self._begun = self._looked = self._guide = self._since = math.nan

    def add(
        self,
        frame: ByteArray,
        setup: Setup,
        angle: float,
        guide: float,
        *,
        followed: float,
        colour: ColourModel | None,
    ) -> str:
        """Take a frame; return where the camera may stand, empty while that is not known.

        The encoder reads `angle` [rad], the guide stands at `guide` [m], nan where that is missing.
        What is followed as P0 already, with an azimuth so far ahead of the reading [rad], may be a
        later marker; nan if nothing is. The markers' colour is None if it is not known.
        """
        # The live window shows bands of a thick cylinder for 0.46 rad: that is four looks and more.
        if abs(angle - self._looked) < 5.0 * LOOK_STEP:
            return ""
        self._looked = angle
        if math.isnan(self._begun):
            self._begun, self._guide = angle, guide
        way, something = abs(angle - self._begun), math.isfinite(followed)
        if something and math.isnan(self._since):
            self._since = angle
        # A guide that goes back by more than cable lies off lays later markers below the first.
        self.done = way > 2.0 * self._lap or guide < self._guide - LAY_SIGMA
        # A marker before what is followed is in sight with it; a later one may be after half a
        # turn, and lies below it where the guide stands behind.
        self.done |= abs(angle - self._since) > math.pi
        if self.done or (something and not self._due(angle + followed, setup.usable_azimuth)):
            return ""
        found = []
        if colour is not None:
            self._along.add(frame, setup, angle)
            found = [
                band.z
                for band in _coloured(self._along.proven, colour)
                if abs(band.z) > SEARCH_REACH
                and not (something and self._strange(band.offset - followed))
            ]
        along = min(found, default=0.0)
        if something:
            return beside_its_place(along, setup) if along < 0.0 else ""
        heights = list(self._higher(frame, setup, angle, colour))
        if way < self._lap or not (found or heights):
            return ""
        if found:
            return beside_its_place(along, setup)
        return beside_its_place(min(heights, key=abs), setup, "in height", "x")

    def _higher(
        self, frame: ByteArray, setup: Setup, angle: float, colour: ColourModel | None
    ) -> Iterator[float]:
        """Yield errors of the camera's height with which P0 is found [m]."""
        for error, search in self._heights.items():
            view = setup.camera._replace(y=setup.camera.y - error)
            search.add(frame, setup._replace(camera=view), angle)
            for band in _coloured(search.proven, colour):
                # An encoder that is not zeroed would tell nothing of a height.
                beyond = setup.body.rho * math.sin(band.offset)
                if abs(beyond) < STEP:
                    yield error + beyond

    def _due(self, azimuth: float, usable: float) -> bool:
        """Return whether a marker before the one at an azimuth [rad] may be in sight."""
        before = [math.remainder(azimuth + n * self._gap, math.tau) for n in (1, 2)]
        return any(-BAND_REACH < place < usable for place in before)

    def _strange(self, ahead: float) -> bool:
        """Return whether a band so far ahead of a marker [rad] is none of those before it."""
        off = [math.remainder(ahead - n * self._gap, math.tau) for n in (1, 2)]
        return min(map(abs, off)) > BAND_REACH


def _coloured(bands: list[MovingBand], colour: ColourModel | None) -> list[MovingBand]:
    """Return the bands of the markers' colour, where that is known: a cylinder may have the hue."""
    return [
        band
        for band in bands
        if colour is None or colour.mask(np.concatenate(band.samples)[None]).mean() > WHOLE_ENOUGH
    ]


def beside_its_place(
    error: float, setup: Setup, where: str = "along the axis", axis: str = "y"
) -> str:
    """Say that the camera's place is wrong by an error [m], or its turn about an axis."""
    turned = abs(error) / abs(setup.camera.x)
    return (
        f"P0 passes {abs(error) / MILLIMETRE:.0f} mm beside its place: the camera's place {where} "
        f"is wrong by so much, or its turn about {axis} by {turned / MILLIRADIAN:.0f} mrad; set "
        "camera_tilt or camera_position"
    )


def colourless(frame: ByteArray, config: TrackerConfig) -> str:
    """Return why a single picture shows no marker at all; empty if it may."""
    spread = frame.max(axis=2).astype(np.int16) - frame.min(axis=2)
    coloured = spread > GREY_LEVELS
    if coloured.mean() < COLOURED_SHARE:
        return (
            f"the picture has no colour: {coloured.mean():.2%} of its pixels are not grey, and "
            "markers are found by their colour; a mosaic that is read as grey needs encoding set "
            "to its bayer pattern"
        )
    hue, saturation, _ = hsv(frame[coloured])
    sought, off = config.marker_hue, config.marker_hue_tolerance
    away = np.abs(hue_difference(hue, sought))
    strong = saturation > SATURATIONS[0]
    if strong.sum() < COLOURED_SHARE * coloured.size or (away <= off).sum() >= 4:
        return ""
    counts = np.bincount((hue[strong] // 10.0).astype(np.int64), minlength=36)
    most = 10.0 * int(counts.argmax()) + 5.0
    return (
        f"nothing in the picture has the hue of a marker, {sought:g} +- {off:g} deg: the strongest "
        f"colours are about {most:.0f} deg, is that marker_hue?"
    )
