"""From radiance to grey levels: exposure, read and shot noise, eight bits."""

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
    """Noise of one frame."""

    read: float  # Standard deviation of a dark pixel [grey levels]
    shot: float  # Variance per grey level of signal
    table: SingleArray  # Standard normal numbers, shape (n,)
    # Where each row starts to read the table, shape (rows,); a row needs 3 * columns numbers after
    # it.
    offsets: IndexArray


class Falloff(NamedTuple):
    """Light that reaches the sensor, the difference of two parts, 1 in the middle."""

    across: SingleArray  # Part of each number of a row, shape (3 * columns,)
    down: SingleArray  # What a row loses, shape (rows,)


def falloff(shape: tuple[int, int], loss: float) -> Falloff:
    """Return the light on a sensor of a shape that loses a share of it towards its corners."""
    rows, columns = shape
    across = 1.0 - 0.5 * loss * np.linspace(-1.0, 1.0, columns) ** 2
    down = 0.5 * loss * np.linspace(-1.0, 1.0, rows) ** 2
    return Falloff(np.repeat(across, 3).astype(np.float32), down.astype(np.float32))


@compiled
def expose(
    radiance: SingleArray, light: Falloff, gain: float, noise: Noise, out: ByteArray
) -> None:  # pragma: no cover
    """Write the eight-bit frame of a radiance image.

    Args:
        radiance: Shape (rows, 3 * columns).
        light: On the sensor.
        gain: Exposure factor.
        noise: Of the sensor.
        out: Shape (rows, 3 * columns).
    """
    rows, size = radiance.shape
    # One type, whole rows and no table: the inner loop then runs on whole vectors.
    black, white, half = np.float32(0.0), np.float32(255.0), np.float32(0.5)
    read, shot, factor = np.float32(noise.read**2), np.float32(noise.shot), np.float32(gain)
    for row in range(rows):
        start = noise.offsets[row]
        source, target = radiance[row], out[row]
        normal = noise.table[start : start + size]
        loss = light.down[row]
        for k in range(size):
            value = source[k] * (factor * (light.across[k] - loss))
            level = min(max(value, black), white)
            value = value + math.sqrt(read + shot * level) * normal[k] + half
            target[k] = np.uint8(min(max(value, black), white))
