"""Depth-buffered samples, points of facets, and triangles written into samples."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

# What a corner of a facet holds, and what a sample holds: its label in the place of the column.
COLUMN, NEAR, SHADE, GLOSS, ROW = 0, 1, 2, 3, 4
LABEL = 0

# Frames are resolved in blocks of a row of this many pixels.
BLOCK = 8


class Point(NamedTuple):
    """A point of a facet: place on the sample grid, inverse depth [1/m], shade and gloss."""

    column: float
    near: float
    shade: float
    gloss: float
    row: float


class Samples(NamedTuple):
    """Buffers of the samples.

    Attributes:
        seen: Label, inverse depth (the cylinder's for no label), shade and gloss of what is seen,
            shape (rows * per_pixel, columns * per_pixel, 4).
        touched: One for each block of pixels that was drawn into, shape (rows, blocks).
        shown: One for each block of the radiance image that is not background, shape of touched.
        per_pixel: Samples per pixel and direction.
    """

    seen: SingleArray
    touched: ByteArray
    shown: ByteArray
    per_pixel: int


@called
def between(one: Point, other: Point, share: float) -> Point:  # pragma: no cover
    """Return the point at a share of the way from one to another."""
    return Point(
        one.column + share * (other.column - one.column),
        one.near + share * (other.near - one.near),
        one.shade + share * (other.shade - one.shade),
        one.gloss + share * (other.gloss - one.gloss),
        one.row + share * (other.row - one.row),
    )


@called
def touch(
    touched: ByteArray, row: int, first: int, last: int, per_pixel: int
) -> None:  # pragma: no cover
    """Note that samples of a row are drawn into, from a first to a last column."""
    for block in range(first // (per_pixel * BLOCK), last // (per_pixel * BLOCK) + 1):
        touched[row // per_pixel, block] = 1


@called
def fill_triangle(
    a: Point, b: Point, c: Point, value: int, seen: SingleArray
) -> None:  # pragma: no cover
    """Write the samples of a triangle where they lie before what is there."""
    top = max(math.ceil(min(a.row, b.row, c.row)), 0)
    bottom = min(math.floor(max(a.row, b.row, c.row)), seen.shape[0] - 1)
    left = max(math.ceil(min(a.column, b.column, c.column)), 0)
    right = min(math.floor(max(a.column, b.column, c.column)), seen.shape[1] - 1)
    b_column, b_row = b.column - a.column, b.row - a.row
    c_column, c_row = c.column - a.column, c.row - a.row
    area = b_column * c_row - b_row * c_column
    if top > bottom or left > right or area == 0.0:
        return
    scale = 1.0 / area
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            x, y = column - a.column, row - a.row
            v, w = (x * c_row - y * c_column) * scale, (y * b_column - x * b_row) * scale
            u = 1.0 - v - w
            if u >= 0.0 and v >= 0.0 and w >= 0.0:
                near = u * a.near + v * b.near + w * c.near
                if near > seen[row, column, NEAR]:
                    seen[row, column, LABEL] = value
                    seen[row, column, NEAR] = near
                    seen[row, column, SHADE] = u * a.shade + v * b.shade + w * c.shade
                    seen[row, column, GLOSS] = u * a.gloss + v * b.gloss + w * c.gloss
