"""Depth-buffered triangles on the sample grid, and the mean of the samples of each pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import compiled

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

# Frames are resolved in blocks of a row of this many pixels; untouched ones are background.
BLOCK = 16


class Corner(NamedTuple):
    """A corner of a triangle: place on the sample grid, inverse depth [1/m], shade and gloss."""

    column: float
    row: float
    inverse_depth: float
    shade: float
    gloss: float


class Samples(NamedTuple):
    """Buffers of the samples, `inverse_depth`, `label`, `shade` and `gloss` of one shape.

    Attributes:
        inverse_depth: Of what is seen [1/m], shape (rows * per_pixel, columns * per_pixel).
        label: Of what was drawn, zero for nothing.
        shade: Diffuse light.
        gloss: Highlight.
        touched: One for each block of pixels that was drawn into, shape (rows, blocks).
        per_pixel: Samples per pixel and direction.
    """

    inverse_depth: SingleArray
    label: ByteArray
    shade: SingleArray
    gloss: SingleArray
    touched: ByteArray
    per_pixel: int


@compiled
def fill_triangle(
    a: Corner, b: Corner, c: Corner, value: int, samples: Samples
) -> None:  # pragma: no cover
    """Write a label, shade and gloss of a triangle where it lies before what is there."""
    rows, columns = samples.inverse_depth.shape
    top = max(math.ceil(min(a.row, b.row, c.row)), 0)
    bottom = min(math.floor(max(a.row, b.row, c.row)), rows - 1)
    left = max(math.ceil(min(a.column, b.column, c.column)), 0)
    right = min(math.floor(max(a.column, b.column, c.column)), columns - 1)
    if top > bottom or left > right:
        return
    area = (b.column - a.column) * (c.row - a.row) - (b.row - a.row) * (c.column - a.column)
    if area == 0.0:
        return
    block_size = samples.per_pixel * BLOCK
    for block_row in range(top // samples.per_pixel, bottom // samples.per_pixel + 1):
        for block in range(left // block_size, right // block_size + 1):
            samples.touched[block_row, block] = 1
    scale = 1.0 / area
    u_column = (b.row - c.row) * scale
    v_column = (c.row - a.row) * scale
    for row in range(top, bottom + 1):
        u = (b.column - left) * (c.row - row) - (b.row - row) * (c.column - left)
        v = (c.column - left) * (a.row - row) - (c.row - row) * (a.column - left)
        u, v = u * scale, v * scale
        for column in range(left, right + 1):
            w = 1.0 - u - v
            if u >= 0.0 and v >= 0.0 and w >= 0.0:
                near = u * a.inverse_depth + v * b.inverse_depth + w * c.inverse_depth
                if near > samples.inverse_depth[row, column]:
                    samples.inverse_depth[row, column] = near
                    samples.label[row, column] = value
                    samples.shade[row, column] = u * a.shade + v * b.shade + w * c.shade
                    samples.gloss[row, column] = u * a.gloss + v * b.gloss + w * c.gloss
            u += u_column
            v += v_column


@compiled
def resolve(
    background: SingleArray,
    behind: SingleArray,
    palette: FloatArray,
    samples: Samples,
    out: SingleArray,
) -> None:  # pragma: no cover
    """Write the mean radiance of each pixel and clear the samples for the next frame.

    Args:
        background: Radiance without the cable, shape (rows, columns, 3).
        behind: Inverse depth of the cylinder at each sample [1/m].
        palette: Reflectance by label, shape (labels, 3).
        samples: What was drawn.
        out: Radiance, shape (rows, columns, 3).
    """
    rows, columns = background.shape[:2]
    size = samples.per_pixel
    share = np.float32(1.0 / (size * size))
    for row in range(rows):
        for block in range(samples.touched.shape[1]):
            first, last = block * BLOCK, min((block + 1) * BLOCK, columns)
            out[row, first:last] = background[row, first:last]
            if samples.touched[row, block] == 0:
                continue
            samples.touched[row, block] = 0
            for column in range(first, last):
                blue, green, red = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                hits = 0
                for j in range(row * size, (row + 1) * size):
                    for i in range(column * size, (column + 1) * size):
                        value = samples.label[j, i]
                        if value:
                            hits += 1
                            light = samples.shade[j, i]
                            white = np.float32(255.0) * samples.gloss[j, i]
                            blue += np.float32(palette[value, 0]) * light + white
                            green += np.float32(palette[value, 1]) * light + white
                            red += np.float32(palette[value, 2]) * light + white
                            samples.label[j, i] = 0
                            samples.inverse_depth[j, i] = behind[j, i]
                if hits:
                    rest = np.float32(1.0) - np.float32(hits) * share
                    out[row, column, 0] = blue * share + rest * background[row, column, 0]
                    out[row, column, 1] = green * share + rest * background[row, column, 1]
                    out[row, column, 2] = red * share + rest * background[row, column, 2]
