"""Compressed preview of a frame for operators."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def encode_jpeg(frame: NDArray[np.uint8], quality: int = 80, shrink: int = 1) -> bytes:
    """Return a frame as JPEG.

    Args:
        frame: Blue-green-red, shape (rows, columns, 3).
        quality: 1 to 100.
        shrink: Whole factor by which both sides are reduced first.

    Raises:
        ValueError: The quality or the factor is out of its range.
    """
    if not 1 <= quality <= 100:
        raise ValueError(f"quality must lie in 1 to 100, got {quality}")
    if shrink < 1:
        raise ValueError(f"shrink must be at least 1, got {shrink}")
    if shrink > 1:
        size = (frame.shape[1] // shrink, frame.shape[0] // shrink)
        frame = np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"a frame of shape {frame.shape} cannot be encoded as JPEG")
    return bytes(data)
