"""What is wrong with pictures, or with angles, where P0 is not found where it must pass."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np

from marker_tracker_node.arrays import ByteArray
from marker_tracker_node.detection.colour import hsv, hue_difference
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.p0_search import SATURATIONS, BandSearch
from marker_tracker_node.tracking.state import Setup

# Pixels whose channels differ by less have no colour, and a picture with so few of others neither.
GREY_LEVELS = 24
COLOURED_SHARE = 2.0e-4
# Readings that leap so far between frames may be degrees [rad]: a cylinder turns less.
LEAP = 0.5

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
        self._config = config
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
        """Return whether the encoder's reading [rad] lies far from the one before."""
        return abs(angle - self._last) > LEAP

    def add(self, frame: ByteArray, setup: Setup, angle: float) -> str:
        """Take a frame of shape (rows, columns, 3), at a reading of the encoder [rad].

        Return what is wrong with the pictures, empty while that is not known.
        """
        leaping = self.leaps(angle)
        self._last = angle
        for sentence, search in self._searches.items():
            if sentence is _DEGREES and not leaping:
                continue
            changed = np.ascontiguousarray(_CHANGES[sentence](frame))
            if search.add(changed, setup, math.radians(angle) if sentence is _DEGREES else angle):
                return sentence
        return ""


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
