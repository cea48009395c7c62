"""From radiance to grey levels: exposure, read and shot noise, eight bits."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import compiled

SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]
IndexArray = NDArray[np.int64]

NOISE_TABLE_SIZE = 1 << 20


def noise_table(seed: int = 20230301) -> SingleArray:
    """Return standard normal numbers that rows of pixels read from a random offset."""
    return np.random.default_rng(seed).standard_normal(NOISE_TABLE_SIZE, dtype=np.float32)


def demosaiced(frame: ByteArray) -> ByteArray:
    """Return what a sensor with an RGGB colour filter makes of a frame.

    Each pixel keeps one channel and the other two are interpolated between its neighbours.
    """
    raw = frame[..., 1].copy()
    raw[0::2, 0::2] = frame[0::2, 0::2, 2]
    raw[1::2, 1::2] = frame[1::2, 1::2, 0]
    # OpenCV names the pattern by the second row's second and third pixel.
    return np.asarray(cv2.cvtColor(raw, cv2.COLOR_BayerBG2BGR), dtype=np.uint8)


class Noise(NamedTuple):
    """Noise of one frame.

    Attributes:
        read: Standard deviation of a dark pixel [grey levels].
        shot: Variance per grey level.
        table: Standard normal numbers, shape (n,).
        offsets: Where each row starts to read the table, shape (rows,); a row needs 3 * columns
            numbers after it.
    """

    read: float
    shot: float
    table: SingleArray
    offsets: IndexArray


@compiled
def expose(
    radiance: SingleArray, falloff: SingleArray, gain: float, noise: Noise, out: ByteArray
) -> None:  # pragma: no cover
    """Write the eight-bit frame of a radiance image.

    Args:
        radiance: Shape (rows, columns, 3).
        falloff: Light at each pixel, shape (rows, columns).
        gain: Exposure factor.
        noise: Of the sensor.
        out: Shape (rows, columns, 3).
    """
    rows, columns = falloff.shape
    deviation = np.empty(256, dtype=np.float32)
    for level in range(256):
        deviation[level] = math.sqrt(noise.read * noise.read + noise.shot * level)
    noisy = noise.read > 0.0 or noise.shot > 0.0
    for row in range(rows):
        cursor = noise.offsets[row]
        for column in range(columns):
            light = np.float32(gain) * falloff[row, column]
            for channel in range(3):
                value = radiance[row, column, channel] * light
                if noisy:
                    level = min(max(int(value), 0), 255)
                    value += deviation[level] * noise.table[cursor]
                    cursor += 1
                value = value + np.float32(0.5)
                out[row, column, channel] = np.uint8(min(max(value, 0.0), 255.0))
