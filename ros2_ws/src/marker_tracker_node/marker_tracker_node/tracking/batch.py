"""A burst of frames in one compiled call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.compiled import compiled
from marker_tracker_node.tracking.frame_update import advance
from marker_tracker_node.tracking.state import ANGLE

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]


@compiled
def advance_all(
    frames: ByteArray,
    table: ByteArray,
    view: FloatArray,
    config: FloatArray,
    shared: FloatArray,
    marks: FloatArray,
    candidates: FloatArray,
    path: FloatArray,
    times: FloatArray,
    encoders: FloatArray,
    guides: FloatArray,
    angles: FloatArray,
    out: FloatArray,
) -> None:  # pragma: no cover
    """Advance the state by every frame of a burst.

    Args:
        frames: Shape (k, rows, columns, 3).
        table: See `gate_moments`.
        view: See `PinholeCamera.numbers`.
        config: See `TrackerConfig.numbers`.
        shared: See `state`.
        marks: See `state`.
        candidates: See `state`.
        path: See `TrackerState.path`.
        times: Ascending [s], shape (k,).
        encoders: Cylinder angles [rad], nan where missing, shape (k,).
        guides: Guide positions [m], nan for none, shape (k,).
        angles: Receives the cylinder angle used for each frame [rad], shape (k,).
        out: See `state`, shape (k, markers, OUTPUT_SIZE).
    """
    for k in range(frames.shape[0]):
        advance(
            frames[k], table, view, config, shared, marks, candidates, path, times[k],
            encoders[k], guides[k], out[k],
        )  # fmt: skip
        angles[k] = shared[ANGLE]
