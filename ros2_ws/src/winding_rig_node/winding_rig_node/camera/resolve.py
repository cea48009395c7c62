"""The mean of the samples of each pixel, in blocks that the cable touches now or did before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import compiled
from winding_rig_node.camera.raster import BLOCK, GLOSS, LABEL, NEAR, SHADE, Samples

SingleArray = NDArray[np.float32]


@compiled
def resolve(
    background: SingleArray,
    behind: SingleArray,
    colours: SingleArray,
    samples: Samples,
    out: SingleArray,
) -> None:  # pragma: no cover
    """Bring a radiance image up to what was drawn and clear the samples for the next frame.

    Args:
        background: Radiance without the cable, shape (rows, columns, 3).
        behind: Inverse depth of the cylinder at each sample [1/m].
        colours: Reflectance of cable and markers, shape (2, 3).
        samples: What was drawn.
        out: Radiance, shape (rows, columns, 3), as the last call left it.
    """
    rows, columns = background.shape[:2]
    seen, touched, shown, size = samples.seen, samples.touched, samples.shown, samples.per_pixel
    for row in range(rows):
        for block in range(touched.shape[1]):
            drawn = touched[row, block]
            if not (drawn or shown[row, block]):
                continue
            touched[row, block] = 0
            shown[row, block] = drawn
            for column in range(block * BLOCK, min((block + 1) * BLOCK, columns)):
                for channel in range(3):
                    out[row, column, channel] = background[row, column, channel]
                if drawn:
                    _resolve_pixel(row, column, size, behind, colours, seen, out)


@compiled
def _resolve_pixel(
    row: int,
    column: int,
    size: int,
    behind: SingleArray,
    colours: SingleArray,
    seen: SingleArray,
    out: SingleArray,
) -> None:  # pragma: no cover
    """Mix the samples of a pixel with the background that stands there, and clear them."""
    cable, marker, white = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    hits = 0
    for j in range(row * size, (row + 1) * size):
        for i in range(column * size, (column + 1) * size):
            value = seen[j, i, LABEL]
            if value > 0.0:
                hits += 1
                if value == 1.0:
                    cable += seen[j, i, SHADE]
                else:
                    marker += seen[j, i, SHADE]
                white += seen[j, i, GLOSS]
                seen[j, i, LABEL] = 0.0
                seen[j, i, NEAR] = behind[j, i]
    if hits:
        share = np.float32(1.0 / (size * size))
        rest = np.float32(1.0) - np.float32(hits) * share
        for channel in range(3):
            light = colours[0, channel] * cable + colours[1, channel] * marker
            mean = (light + np.float32(255.0) * white) * share
            out[row, column, channel] = mean + rest * out[row, column, channel]
