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
        colours: Reflectance of the cable and of each marker, shape (1 + markers, 3).
        samples: What was drawn.
        out: Radiance, shape (rows, columns, 3), as the last call left it.
    """
    rows, columns = background.shape[:2]
    seen, touched, shown, size = samples.seen, samples.touched, samples.shown, samples.per_pixel
    nothing, one, glare = np.float32(0.0), np.float32(1.0), np.float32(255.0)
    share = np.float32(1.0 / (size * size))
    for row in range(rows):
        for block in range(touched.shape[1]):
            drawn = touched[row, block]
            if not (drawn or shown[row, block]):
                continue
            touched[row, block] = 0
            shown[row, block] = drawn
            for column in range(block * BLOCK, min((block + 1) * BLOCK, columns)):
                hits, cable, marker, white = nothing, nothing, nothing, nothing
                which = one
                if drawn:
                    for j in range(row * size, (row + 1) * size):
                        for i in range(column * size, (column + 1) * size):
                            label, shade = seen[j, i, LABEL], seen[j, i, SHADE]
                            hits += min(label, one)
                            cable += shade if label == one else nothing
                            marker += shade if label > one else nothing
                            which = max(which, label)
                            white += seen[j, i, GLOSS]
                            seen[j, i, LABEL] = nothing
                            seen[j, i, NEAR] = behind[j, i]
                            seen[j, i, SHADE] = nothing
                            seen[j, i, GLOSS] = nothing
                # Markers of two colours share next to no pixel: the later one's is taken.
                paint = int(which) - 1
                rest = one - hits * share
                for channel in range(3):
                    light = colours[0, channel] * cable + colours[paint, channel] * marker
                    mean = (light + glare * white) * share
                    out[row, column, channel] = mean + rest * background[row, column, channel]
