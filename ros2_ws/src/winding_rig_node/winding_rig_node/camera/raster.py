"""Depth-buffered triangles on the sample grid, and the mean of the samples of each pixel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.compiled import compiled

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

# Frames are resolved in blocks of a row of this many pixels; untouched ones are background.
BLOCK = 16


@compiled
def fill_triangle(
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    value: int,
    inverse_depth: SingleArray,
    label: ByteArray,
    shade: SingleArray,
    gloss: SingleArray,
    touched: ByteArray,
    samples: int,
) -> None:  # pragma: no cover
    """Write label, shade and gloss of a triangle where it lies before what is there.

    Args:
        a: Column, row, inverse depth [1/m], shade, gloss of a corner, shape (5,); b and c alike.
        b: See a.
        c: See a.
        value: Label of the triangle.
        inverse_depth: Buffer, shape (rows, columns); label, shade and gloss have the same shape.
        label: See inverse_depth.
        shade: See inverse_depth.
        gloss: See inverse_depth.
        touched: Receives one for each block that the triangle may change, shape (rows, blocks).
        samples: Per pixel and direction.
    """
    rows, columns = inverse_depth.shape
    top = max(math.ceil(min(a[1], b[1], c[1])), 0)
    bottom = min(math.floor(max(a[1], b[1], c[1])), rows - 1)
    left = max(math.ceil(min(a[0], b[0], c[0])), 0)
    right = min(math.floor(max(a[0], b[0], c[0])), columns - 1)
    if top > bottom or left > right:
        return
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == 0.0:
        return
    for block_row in range(top // samples, bottom // samples + 1):
        for block in range(left // (samples * BLOCK), right // (samples * BLOCK) + 1):
            touched[block_row, block] = 1
    scale = 1.0 / area
    u_column = (b[1] - c[1]) * scale
    v_column = (c[1] - a[1]) * scale
    for row in range(top, bottom + 1):
        u = (b[0] - left) * (c[1] - row) - (b[1] - row) * (c[0] - left)
        v = (c[0] - left) * (a[1] - row) - (c[1] - row) * (a[0] - left)
        u, v = u * scale, v * scale
        for column in range(left, right + 1):
            w = 1.0 - u - v
            if u >= 0.0 and v >= 0.0 and w >= 0.0:
                near = u * a[2] + v * b[2] + w * c[2]
                if near > inverse_depth[row, column]:
                    inverse_depth[row, column] = near
                    label[row, column] = value
                    shade[row, column] = u * a[3] + v * b[3] + w * c[3]
                    gloss[row, column] = u * a[4] + v * b[4] + w * c[4]
            u += u_column
            v += v_column


@compiled
def resolve(
    samples: int,
    background: SingleArray,
    behind: SingleArray,
    palette: FloatArray,
    inverse_depth: SingleArray,
    label: ByteArray,
    shade: SingleArray,
    gloss: SingleArray,
    touched: ByteArray,
    out: SingleArray,
) -> None:  # pragma: no cover
    """Write the mean radiance of each pixel and clear the sample buffers for the next frame.

    Args:
        samples: Per pixel and direction.
        background: Radiance without the cable, shape (rows, columns, 3).
        behind: Inverse depth of the cylinder at each sample [1/m].
        palette: Reflectance by label, shape (labels, 3).
        inverse_depth: Buffer, shape (rows * samples, columns * samples).
        label: Same shape; zero for none.
        shade: Same shape.
        gloss: Same shape.
        touched: Blocks that were drawn into, shape (rows, blocks).
        out: Radiance, shape (rows, columns, 3).
    """
    rows, columns = background.shape[:2]
    share = np.float32(1.0 / (samples * samples))
    for row in range(rows):
        for block in range(touched.shape[1]):
            first, last = block * BLOCK, min((block + 1) * BLOCK, columns)
            out[row, first:last] = background[row, first:last]
            if touched[row, block] == 0:
                continue
            touched[row, block] = 0
            for column in range(first, last):
                blue, green, red = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                hits = 0
                for j in range(row * samples, (row + 1) * samples):
                    for i in range(column * samples, (column + 1) * samples):
                        value = label[j, i]
                        if value:
                            hits += 1
                            light = shade[j, i]
                            white = np.float32(255.0) * gloss[j, i]
                            blue += np.float32(palette[value, 0]) * light + white
                            green += np.float32(palette[value, 1]) * light + white
                            red += np.float32(palette[value, 2]) * light + white
                            label[j, i] = 0
                            inverse_depth[j, i] = behind[j, i]
                if hits:
                    rest = np.float32(1.0) - np.float32(hits) * share
                    out[row, column, 0] = blue * share + rest * background[row, column, 0]
                    out[row, column, 1] = green * share + rest * background[row, column, 1]
                    out[row, column, 2] = red * share + rest * background[row, column, 2]
