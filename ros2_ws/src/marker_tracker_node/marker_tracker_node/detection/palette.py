"""The colours of a run's markers, and what light makes of them, as the kernels look them up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.detection.colour import ColourModel, hue_distance
from marker_tracker_node.detection.gate import ANY, FIRST_COLOUR, TABLE_SIZE, Picture

ByteArray = NDArray[np.uint8]
IndexArray = NDArray[np.int64]


class Palette(NamedTuple):
    """Which marker has which colour.

    Attributes:
        tables: See `Picture`, shape ((2 + colours) 32768,).
        colour_of: Number of each marker's table, shape (markers,).
    """

    tables: ByteArray
    colour_of: IndexArray

    def picture(self, pixels: ByteArray) -> Picture:
        """Return a frame of shape (rows, columns, 3) in which P0's colour is sought."""
        first = self.tables[FIRST_COLOUR * TABLE_SIZE : (FIRST_COLOUR + 1) * TABLE_SIZE]
        return Picture(pixels, first, self.tables, self.colour_of)

    @property
    def any(self) -> ByteArray:
        """One where a pixel has the colour of any marker, shape (32768,)."""
        return self.tables[ANY * TABLE_SIZE : FIRST_COLOUR * TABLE_SIZE]

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
            hues: Told hue of each marker [deg].
            tolerance: Half width of the hues of one [deg].
        """
        told = list(dict.fromkeys(hues))
        models = [first, *(first.of_hue(hue, tolerance) for hue in told[1:])]
        tables = np.array([model.table for model in models])
        away = hue_distance(np.array([model.hue for model in models]))
        tables &= away == away.min(axis=0)
        glare = np.any([model.glare() > 0 for model in models], axis=0)
        every = tables.any(axis=0)
        return cls(
            np.concatenate([[glare & ~every, every], tables]).astype(np.uint8).ravel(),
            np.array([FIRST_COLOUR + told.index(hue) for hue in hues], dtype=np.int64),
        )
