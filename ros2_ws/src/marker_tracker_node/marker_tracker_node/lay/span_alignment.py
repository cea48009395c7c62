"""The slope of the free span to a small part of a pixel: its rows laid over each other.

All rows show the same cable in the same light. Where each of them stands against the mean of all
is known better than any edge, whose fit errs with the place of the edge within its pixel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.free_span import FreeSpan
from marker_tracker_node.lay.rows import RowTable

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

# Inside the cable, where nothing of what stands behind it shows [half widths].
INSIDE = 0.92
SAMPLES = 49
PASSES = 2


def aligned_rows(
    frame: ByteArray, rows: list[RowTable], span: FreeSpan
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return way [m], z [m] and the standard deviation of z [m] of each row's cable.

    Args:
        frame: Blue-green-red, shape (rows, columns, 3).
        rows: Over the free span.
        span: As the edges tell it; the mean z stays as it says.
    """
    at = np.linspace(-INSIDE, INSIDE, SAMPLES)
    signals = [_signal(frame, row) for row in rows]
    ways = np.empty(len(rows))
    columns, halves, scales = (np.empty(len(rows)) for _ in range(3))
    for k, row in enumerate(rows):
        middle = row.z.size // 2
        ways[k] = row.place[middle]
        columns[k] = np.interp(span.contact_z + span.slope * ways[k], row.z, np.arange(row.z.size))
        u = int(np.clip(columns[k], 0, row.z.size - 2))
        ways[k] = row.place[u]
        halves[k] = row.half[u] / np.cos(span.angle)
        scales[k] = row.z[u + 1] - row.z[u]
    moved = np.zeros(len(rows))
    sigma = np.full(len(rows), np.inf)
    for _ in range(PASSES):
        profiles = np.array(
            [
                _cubic(signal, column + half * at)
                for signal, column, half in zip(signals, columns + moved, halves, strict=True)
            ]
        )
        levels = profiles.mean(axis=1, keepdims=True)
        mean = (profiles / levels).mean(axis=0)
        steep = np.gradient(mean, at)
        parts = np.stack([np.ones_like(mean), mean - mean.mean(), steep])
        solve = np.linalg.pinv(parts.T)
        # What a row shows is the mean, brighter or darker, with more or less contrast, and moved.
        fit = solve @ (profiles / levels).T
        left = profiles / levels - (parts.T @ fit).T
        moved -= fit[2] * halves / np.maximum(fit[1], 0.3)
        scatter = np.sqrt((left**2).mean(axis=1))
        spread = np.sqrt(max(float((steep**2).mean()), 1.0e-12))
        # As many samples tell something of their own as there are groups of columns.
        own = np.sqrt(np.maximum(2.0 * INSIDE * halves, 1.0))
        sigma = halves * scatter / (spread * own)
    moved -= np.average(moved, weights=1.0 / np.maximum(sigma, 1.0e-3) ** 2)
    z = np.array(
        [
            np.interp(column + shift, np.arange(row.z.size), row.z)
            for column, shift, row in zip(columns, moved, rows, strict=True)
        ]
    )
    return ways, z, np.maximum(sigma, 0.01) * np.abs(scales)


def _signal(frame: ByteArray, row: RowTable) -> FloatArray:
    """Return the brightness of three rows, means of groups of columns."""
    part = frame[row.row - 1 : row.row + 2].sum(axis=(0, 2), dtype=np.int64)
    used = part[: row.z.size * row.group].reshape(-1, row.group)
    return np.asarray(used.mean(axis=1), dtype=float)


def _cubic(signal: FloatArray, at: FloatArray) -> FloatArray:
    """Return a signal between its places, by cubic interpolation."""
    low = np.clip(np.floor(at).astype(np.int64), 1, signal.size - 3)
    t = at - low
    a, b, c, d = (signal[low + k] for k in (-1, 0, 1, 2))
    return np.asarray(
        b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a))),
        dtype=float,
    )
