"""From a camera's numbers to blue, green and red of 8 bits, in one pass over a picture.

Rows are arrays of uint8, or of uint16 in the order of this machine's bytes or swapped.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called, compiled

ByteArray = NDArray[np.uint8]
NumberArray = NDArray[np.uint8] | NDArray[np.uint16]


@called
def _number(value: int, swapped: bool) -> np.uint32:  # pragma: no cover
    """Return a number of a row whose bytes may be swapped."""
    number = np.uint32(value)
    if swapped:
        return ((number & np.uint32(255)) << np.uint32(8)) | (number >> np.uint32(8))
    return number


@compiled
def largest(rows: NumberArray, count: int, swapped: bool) -> int:  # pragma: no cover
    """Return the largest of the first numbers of all rows."""
    most = np.uint32(0)
    for v in range(rows.shape[0]):
        line = rows[v]
        for k in range(count):
            most = max(most, _number(line[k], swapped))
    return int(most)


@compiled
def unpack(
    rows: NumberArray, places: tuple[int, int, int, int], swapped: bool, shift: int, out: ByteArray
) -> None:  # pragma: no cover
    """Write pixels of three or four numbers as blue, green and red.

    Args:
        rows: Numbers, shape (rows, numbers).
        places: Of blue, green and red in a pixel, and how many numbers it has.
        swapped: Whether the bytes of a number are.
        shift: Bits beyond eight.
        out: Receives the picture, shape (rows, columns, 3).
    """
    blue, green, red, count = places
    beyond = np.uint32(shift)
    for v in range(out.shape[0]):
        line, target = rows[v], out[v]
        for u in range(out.shape[1]):
            pixel = line[count * u : count * u + count]
            target[u, 0] = _number(pixel[blue], swapped) >> beyond
            target[u, 1] = _number(pixel[green], swapped) >> beyond
            target[u, 2] = _number(pixel[red], swapped) >> beyond


@compiled
def demosaic(
    rows: NumberArray, red: tuple[int, int], swapped: bool, shift: int, out: ByteArray
) -> None:  # pragma: no cover
    """Write a mosaic of colours as blue, green and red.

    What a pixel does not see is the mean of its nearest neighbours that do; the picture goes on
    beyond its edges as in a mirror, which keeps the pattern.

    Args:
        rows: One number a pixel, shape (rows, columns or more).
        red: Row and column of the first red pixel.
        swapped: Whether the bytes of a number are.
        shift: Bits beyond eight.
        out: Receives the picture, shape (rows, columns, 3), at least 2 x 2.
    """
    height, width = out.shape[0], out.shape[1]
    for v in range(height):
        above, here = rows[v - 1 if v > 0 else 1], rows[v]
        below, line = rows[v + 1 if v < height - 1 else height - 2], out[v]
        # The colour that this row has beside green, and its first column.
        own = 2 if v % 2 == red[0] else 0
        first = red[1] if own == 2 else 1 - red[1]
        for u in range(first, width, 2):
            west, east = (u - 1 if u > 0 else 1), (u + 1 if u < width - 1 else width - 2)
            cross = (
                _number(above[u], swapped) + _number(below[u], swapped)
                + _number(here[west], swapped) + _number(here[east], swapped)
            )  # fmt: skip
            corners = (
                _number(above[west], swapped) + _number(above[east], swapped)
                + _number(below[west], swapped) + _number(below[east], swapped)
            )  # fmt: skip
            line[u, own] = _number(here[u], swapped) >> np.uint32(shift)
            line[u, 1] = cross >> np.uint32(shift + 2)
            line[u, 2 - own] = corners >> np.uint32(shift + 2)
        for u in range(1 - first, width, 2):
            west, east = (u - 1 if u > 0 else 1), (u + 1 if u < width - 1 else width - 2)
            level = _number(here[west], swapped) + _number(here[east], swapped)
            upright = _number(above[u], swapped) + _number(below[u], swapped)
            line[u, own] = level >> np.uint32(shift + 1)
            line[u, 1] = _number(here[u], swapped) >> np.uint32(shift)
            line[u, 2 - own] = upright >> np.uint32(shift + 1)
