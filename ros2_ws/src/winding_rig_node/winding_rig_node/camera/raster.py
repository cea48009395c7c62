"""Depth-buffered triangles on the sample grid, and the mean of the samples of each pixel."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import compiled

SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

# Frames are resolved in blocks of a row of this many pixels.
BLOCK = 8


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
        shown: One for each block of the radiance image that is not background, shape of touched.
        per_pixel: Samples per pixel and direction.
    """

    inverse_depth: SingleArray
    label: ByteArray
    shade: SingleArray
    gloss: SingleArray
    touched: ByteArray
    shown: ByteArray
    per_pixel: int


@compiled
def touch(
    samples: Samples, left: float, right: float, top: float, bottom: float
) -> bool:  # pragma: no cover
    """Note that a rectangle of samples is drawn into; return whether it lies in the window."""
    rows, columns = samples.inverse_depth.shape
    if not (left < columns and right >= 0.0 and top < rows and bottom >= 0.0):
        return False
    size = samples.per_pixel
    first, last = int(max(left, 0.0)) // size, int(min(right, columns - 1.0)) // size
    for row in range(int(max(top, 0.0)) // size, int(min(bottom, rows - 1.0)) // size + 1):
        for block in range(first // BLOCK, last // BLOCK + 1):
            samples.touched[row, block] = 1
    return True


@compiled
def fill_triangle(
    a: Corner, b: Corner, c: Corner, value: int, samples: Samples
) -> None:  # pragma: no cover
    """Write a label, shade and gloss of a triangle where it lies before what is there."""
    rows, columns = samples.inverse_depth.shape
    top = max(math.ceil(min(a.row, b.row, c.row)), 0)
    bottom = min(math.floor(max(a.row, b.row, c.row)), rows - 1)
    if top > bottom:
        return
    area = (b.column - a.column) * (c.row - a.row) - (b.row - a.row) * (c.column - a.column)
    if area == 0.0:
        return
    scale = 1.0 / area
    # Weights of the corners b and c: their change along a row and down a column.
    v_column, v_row = (c.row - a.row) * scale, (a.column - c.column) * scale
    w_column, w_row = (a.row - b.row) * scale, (b.column - a.column) * scale
    near_b, near_c = b.inverse_depth - a.inverse_depth, c.inverse_depth - a.inverse_depth
    shade_b, shade_c = b.shade - a.shade, c.shade - a.shade
    gloss_b, gloss_c = b.gloss - a.gloss, c.gloss - a.gloss
    near_step = np.float32(v_column * near_b + w_column * near_c)
    shade_step = np.float32(v_column * shade_b + w_column * shade_c)
    gloss_step = np.float32(v_column * gloss_b + w_column * gloss_c)
    # Each side bounds the columns of a row from the left or from the right.
    side_ab, side_bc, side_ca = _side(a, b, scale), _side(b, c, scale), _side(c, a, scale)
    for row in range(top, bottom + 1):
        left, right = 0.0, columns - 1.0
        for side in (side_ab, side_bc, side_ca):
            place = side.column + side.slope * row
            left = max(left, place if side.bound > 0.0 else left)
            right = min(right, place if side.bound < 0.0 else right)
        first, last = math.ceil(left), math.floor(right)
        if first > last:
            continue
        v = (first - a.column) * v_column + (row - a.row) * v_row
        w = (first - a.column) * w_column + (row - a.row) * w_row
        near = np.float32(a.inverse_depth + v * near_b + w * near_c)
        shade = np.float32(a.shade + v * shade_b + w * shade_c)
        gloss = np.float32(a.gloss + v * gloss_b + w * gloss_c)
        for column in range(first, last + 1):
            if near > samples.inverse_depth[row, column]:
                samples.inverse_depth[row, column] = near
                samples.label[row, column] = value
                samples.shade[row, column] = shade
                samples.gloss[row, column] = gloss
            near += near_step
            shade += shade_step
            gloss += gloss_step


class Side(NamedTuple):
    """A side of a triangle: column at row zero, columns per row, positive if it bounds the left."""

    column: float
    slope: float
    bound: float


@compiled
def _side(one: Corner, other: Corner, scale: float) -> Side:  # pragma: no cover
    rise = other.row - one.row
    slope = (other.column - one.column) / rise if rise != 0.0 else 0.0
    return Side(one.column - slope * one.row, slope, -rise * scale)


@compiled
def resolve(
    background: SingleArray,
    behind: SingleArray,
    colours: SingleArray,
    samples: Samples,
    out: SingleArray,
) -> None:  # pragma: no cover
    """Bring a radiance image up to what was drawn and clear the samples for the next frame.

    Only blocks that were drawn into now or the last time change.

    Args:
        background: Radiance without the cable, shape (rows, columns, 3).
        behind: Inverse depth of the cylinder at each sample [1/m].
        colours: Reflectance of cable and markers, shape (2, 3).
        samples: What was drawn.
        out: Radiance, shape (rows, columns, 3).
    """
    rows, columns = background.shape[:2]
    for row in range(rows):
        for block in range(samples.touched.shape[1]):
            touched = samples.touched[row, block]
            if not (touched or samples.shown[row, block]):
                continue
            samples.touched[row, block] = 0
            samples.shown[row, block] = touched
            for column in range(block * BLOCK, min((block + 1) * BLOCK, columns)):
                for channel in range(3):
                    out[row, column, channel] = background[row, column, channel]
                if touched:
                    _resolve_pixel(row, column, behind, colours, samples, out)


@compiled
def _resolve_pixel(
    row: int,
    column: int,
    behind: SingleArray,
    colours: SingleArray,
    samples: Samples,
    out: SingleArray,
) -> None:  # pragma: no cover
    """Mix the samples of a pixel with the background that stands there, and clear them."""
    size = samples.per_pixel
    cable, marker, white = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    hits = 0
    for j in range(row * size, (row + 1) * size):
        for i in range(column * size, (column + 1) * size):
            value = samples.label[j, i]
            if value:
                hits += 1
                if value == 1:
                    cable += samples.shade[j, i]
                else:
                    marker += samples.shade[j, i]
                white += samples.gloss[j, i]
                samples.label[j, i] = 0
                samples.inverse_depth[j, i] = behind[j, i]
    if hits:
        share = np.float32(1.0 / (size * size))
        rest = np.float32(1.0) - np.float32(hits) * share
        for channel in range(3):
            light = colours[0, channel] * cable + colours[1, channel] * marker
            drawn = (light + np.float32(255.0) * white) * share
            out[row, column, channel] = drawn + rest * out[row, column, channel]
