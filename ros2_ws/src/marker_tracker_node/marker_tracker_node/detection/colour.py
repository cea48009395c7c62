"""The colours of markers: learnt from sampled pixels, against the scene around them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from marker_tracker_node.arrays import ByteArray, FlagArray, FloatArray, IndexArray
from marker_tracker_node.detection.gate import FIRST_COLOUR, TABLE_SIZE, Picture

LEVELS = 32
# Light from a third to three times the sampled one, with the clipping that comes with it.
EXPOSURES = np.geomspace(0.3, 3.0, 13)

MIN_SAMPLES = 8
MIN_SATURATION = 0.25
MAX_HUE_SPREAD = 20.0
HUE_FLOOR = 5.0
HUE_SIGMAS = 4.0
# Clipped channels hide the true hue: shaded parts of the marker show it.
CLIPPED_LEVEL = 250
CLIPPED_SHARE = 0.2
CLIPPED_MARGIN = 14.0
SATURATION_SHARE = 0.62
MIN_VALUE_LEVELS = 32.0
HUE_BINS = 90
SATURATION_BINS = 24
# Brighter than paint by so many levels, with a hue that is known; white is that bright in all
# channels.
GLARE_STEP = 8.0
GLARE_SATURATION = 0.05
WHITE_LEVEL = 240


class ColourRefusedError(ValueError):
    """The sampled pixels cannot define a marker colour."""


@dataclass(frozen=True, kw_only=True)
class ColourModel:
    """A region of hue and saturation, less what the background shows there."""

    hue: float  # Robust middle of the samples [deg]
    hue_spread: float  # Half width of the accepted hues [deg]
    min_saturation: float  # Least accepted saturation, 0 to 1
    # One for each accepted colour, by five bits of blue, green and red, shape (32768,).
    table: ByteArray
    separation: float  # Share of the background samples that the model rejects; nan without any
    # Level of the brightest channel that hardly a sample exceeds, 0 to 255.
    brightest: float = 255.0
    # How often the background shows each hue and saturation; None if that is not known.
    scene: FloatArray | None = None

    @classmethod
    def from_samples(cls, samples: ByteArray, background: ByteArray | None = None) -> ColourModel:
        """Learn the model.

        Args:
            samples: Pixels of the marker, blue-green-red, shape (n, 3).
            background: Pixels of the scene without markers, shape (m, 3).

        Raises:
            ColourRefusedError: There are too few samples, they are grey, of many hues, or one
                single value, which a photographed marker never shows.
        """
        samples = _pixels(samples)
        _require_variation(samples)
        hue, saturation, _ = hsv(samples)
        grey = float(np.median(saturation))
        if grey < MIN_SATURATION:
            raise ColourRefusedError(
                f"samples are grey: median saturation {grey:.2f} is below {MIN_SATURATION}"
            )
        centre, deviation = _circular_middle(hue, saturation)
        if deviation > MAX_HUE_SPREAD:
            raise ColourRefusedError(
                f"samples show many hues: spread {deviation:.0f} deg exceeds {MAX_HUE_SPREAD:.0f}"
            )
        lit_hue, _, _ = hsv(_exposed(samples))
        shift = hue_difference(lit_hue, centre)
        near = np.abs(shift) < 3.0 * MAX_HUE_SPREAD
        low, high = np.percentile(shift[near], [2.0, 98.0])
        margin = max(HUE_FLOOR, min(HUE_SIGMAS * deviation, MAX_HUE_SPREAD))
        if (samples >= CLIPPED_LEVEL).any(axis=1).mean() > CLIPPED_SHARE:
            margin = max(margin, CLIPPED_MARGIN)
        middle = (centre + 0.5 * (low + high)) % 360.0
        spread = 0.5 * (high - low) + margin
        floor = SATURATION_SHARE * float(np.percentile(saturation, 10.0))
        accepted = hue_region(middle, spread, max(floor, 0.5 * MIN_SATURATION))
        separation, scene = math.nan, None
        if background is not None and len(background):
            background = _pixels(background)
            scene = _density(background)
            accepted = accepted & _more_marker_than_background(_density(_exposed(samples)), scene)
            separation = 1.0 - float(accepted[colour_index(background)].mean())
        if not accepted[colour_index(samples)].mean() > 0.5:
            raise ColourRefusedError("samples cannot be distinguished from the background")
        return cls(
            hue=middle,
            hue_spread=spread,
            min_saturation=floor,
            table=accepted.astype(np.uint8),
            separation=separation,
            brightest=float(np.percentile(samples.max(axis=1), 99.0)),
            scene=scene,
        )

    def of_hue(self, hue: float, spread: float) -> ColourModel:
        """Return the model of a paint of hues around another one [deg], in the same scene."""
        accepted = hue_region(hue, spread, self.min_saturation)
        if self.scene is not None:
            accepted = accepted & _more_marker_than_background(
                _density(_table_colours()[accepted]), self.scene
            )
        return replace(
            self, hue=hue, hue_spread=spread, table=accepted.astype(np.uint8), separation=math.nan
        )

    def glare(self) -> ByteArray:
        """Return a table of the colours that light makes of the paint and of anything else.

        White light on top of what the paint reflects leaves its hue, takes its saturation and is
        brighter than paint; where every channel ends, everything is white.
        """
        colours = _table_colours()
        h, s, _ = hsv(colours)
        level = min(self.brightest + GLARE_STEP, CLIPPED_LEVEL)
        pale = (
            (colours.max(axis=1) >= level)
            & (np.abs(hue_difference(h, self.hue)) <= self.hue_spread)
            & (s >= GLARE_SATURATION)
        )
        white = colours.min(axis=1) >= WHITE_LEVEL
        return np.asarray((pale | white) & (self.table == 0), dtype=np.uint8)

    def mask(self, frame: ByteArray) -> FlagArray:
        """Return which pixels of a frame have the marker's colour, shape (rows, columns)."""
        return self.table[colour_index(frame)].astype(bool)


def hsv(pixels: ByteArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return hue [deg], saturation and value (0 to 1) of blue-green-red pixels (..., 3)."""
    flat = np.ascontiguousarray(pixels).reshape(1, -1, 3).astype(np.float32) / 255.0
    planes = cv2.cvtColor(flat, cv2.COLOR_BGR2HSV)[0].astype(float)
    shape = pixels.shape[:-1]
    return planes[:, 0].reshape(shape), planes[:, 1].reshape(shape), planes[:, 2].reshape(shape)


def colour_index(pixels: ByteArray) -> IndexArray:
    """Return the table index of blue-green-red pixels (..., 3)."""
    reduced = (pixels >> 3).astype(np.int64)
    return (reduced[..., 0] << 10) | (reduced[..., 1] << 5) | reduced[..., 2]


def _pixels(samples: ByteArray) -> ByteArray:
    samples = np.asarray(samples)
    if samples.dtype != np.uint8 or samples.ndim != 2 or samples.shape[-1] != 3:
        raise ColourRefusedError(
            f"samples must be uint8 of shape (n, 3), got {samples.dtype} {samples.shape}"
        )
    return samples


def _require_variation(samples: ByteArray) -> None:
    if len(samples) < MIN_SAMPLES:
        raise ColourRefusedError(
            f"at least {MIN_SAMPLES} sampled pixels are needed, got {len(samples)}"
        )
    if (samples == samples[0]).all():
        raise ColourRefusedError(f"samples are uniform: every pixel is {samples[0].tolist()}")


def _circular_middle(hue: FloatArray, saturation: FloatArray) -> tuple[float, float]:
    """Return circular mean [deg] and robust deviation [deg] of hues weighted by saturation."""
    angle = np.radians(hue)
    mean = math.degrees(
        math.atan2(
            float((saturation * np.sin(angle)).sum()), float((saturation * np.cos(angle)).sum())
        )
    )
    difference = hue_difference(hue, mean)
    middle = float(np.median(difference))
    deviation = 1.4826 * float(np.median(np.abs(difference - middle)))
    return (mean + middle) % 360.0, deviation


def hue_difference(hue: FloatArray, centre: float) -> FloatArray:
    """Return how far hues lie beyond another one [deg], within half a turn of zero."""
    return np.asarray((hue - centre + 180.0) % 360.0 - 180.0, dtype=float)


def _exposed(samples: ByteArray) -> ByteArray:
    """Return the samples under every exposure, clipped as the sensor clips."""
    few = samples[:: max(len(samples) // 256, 1)]
    lit = few[None, :, :].astype(float) * EXPOSURES[:, None, None]
    return np.minimum(lit, 255.0).astype(np.uint8).reshape(-1, 3)


def _table_colours() -> ByteArray:
    level = (np.arange(LEVELS) * 8 + 4).astype(np.uint8)
    blue, green, red = np.meshgrid(level, level, level, indexing="ij")
    return np.stack([blue, green, red], axis=-1).reshape(-1, 3)


@lru_cache(maxsize=64)
def hue_region(hue: float, spread: float, min_saturation: float) -> FlagArray:
    """Return which colours of a table are saturated and around a hue [deg], shape (32768,)."""
    h, s, v = hsv(_table_colours())
    region = np.asarray(
        (np.abs(hue_difference(h, hue)) <= spread)
        & (s >= min_saturation)
        & (v >= MIN_VALUE_LEVELS / 255.0),
        dtype=bool,
    )
    # It is kept: a search asks for the same hues in every frame.
    region.flags.writeable = False
    return region


def _more_marker_than_background(marker: FloatArray, scene: FloatArray) -> FlagArray:
    """Return where in the table a marker pixel is likelier than one of the background.

    Densities are histograms of hue and saturation, blurred by the noise of a pixel.
    """
    hue, saturation, _ = hsv(_table_colours())
    cell = _cell(hue, saturation)
    return np.asarray(marker.ravel()[cell] >= scene.ravel()[cell], dtype=bool)


def _cell(hue: FloatArray, saturation: FloatArray) -> IndexArray:
    column = np.minimum((hue / 360.0 * HUE_BINS).astype(np.int64), HUE_BINS - 1)
    row = np.minimum((saturation * SATURATION_BINS).astype(np.int64), SATURATION_BINS - 1)
    return row * HUE_BINS + column


def _density(pixels: ByteArray) -> FloatArray:
    hue, saturation, value = hsv(pixels)
    bright = value * 255.0 >= MIN_VALUE_LEVELS
    counts = np.bincount(
        _cell(hue[bright], saturation[bright]), minlength=HUE_BINS * SATURATION_BINS
    ).astype(float)
    grid = counts.reshape(SATURATION_BINS, HUE_BINS)
    wrapped = np.concatenate([grid[:, -6:], grid, grid[:, :6]], axis=1)
    blurred = cv2.GaussianBlur(wrapped, (0, 0), sigmaX=1.5, sigmaY=1.5)[:, 6:-6]
    return np.asarray(blurred / max(len(pixels), 1), dtype=float)


class Palette(NamedTuple):
    """Which marker has which colour."""

    tables: ByteArray  # See `Picture`, shape ((2 + colours) 32768,)
    colour_of: IndexArray  # Number of each marker's table, shape (markers,)

    def picture(self, pixels: ByteArray) -> Picture:
        """Return a frame of shape (rows, columns, 3) in which P0's colour is sought."""
        first = self.tables[FIRST_COLOUR * TABLE_SIZE : (FIRST_COLOUR + 1) * TABLE_SIZE]
        return Picture(pixels, first, self.tables, self.colour_of)

    @classmethod
    def nothing(cls, markers: int) -> Palette:
        """Return a palette in which nothing is marker."""
        return cls(
            np.zeros((FIRST_COLOUR + 1) * TABLE_SIZE, np.uint8),
            np.full(markers, FIRST_COLOUR, np.int64),
        )

    @classmethod
    def of(cls, first: ColourModel, hues: Sequence[float], tolerance: float) -> Palette:
        """Return the colours of markers of which the first was learnt.

        A colour between two belongs to the nearer one.

        Args:
            first: Of P0.
            hues: Configured hue of each marker [deg].
            tolerance: Half width of the hues of one [deg].
        """
        given = list(dict.fromkeys(hues))
        models = [first, *(first.of_hue(hue, tolerance) for hue in given[1:])]
        tables = np.array([model.table for model in models])
        table_hue, _, _ = hsv(_table_colours())
        away = np.abs([hue_difference(table_hue, model.hue) for model in models])
        tables &= away == away.min(axis=0)
        glare = np.any([model.glare() > 0 for model in models], axis=0)
        every = tables.any(axis=0)
        return cls(
            np.concatenate([[glare & ~every, every], tables]).astype(np.uint8).ravel(),
            np.array([FIRST_COLOUR + given.index(hue) for hue in hues], dtype=np.int64),
        )
