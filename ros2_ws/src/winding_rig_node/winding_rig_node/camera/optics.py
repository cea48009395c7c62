"""Pinhole with Brown-Conrady distortion, forwards for points and backwards once for all rays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.compiled import compiled
from winding_rig_node.camera.config import NOMINAL_AXES, CameraConfig

FloatArray = NDArray[np.float64]

INVERSION_STEPS = 200
INVERSION_TOLERANCE = 1.0e-11

# Layout of the numbers that the kernels take, see `lens_numbers`.
LENS_SIZE = 24


def axes(config: CameraConfig) -> FloatArray:
    """Return the camera's x, y and z axes in the lab frame as columns, shape (3, 3)."""
    return np.asarray(NOMINAL_AXES @ rotation(np.array(config.tilt)), dtype=float)


def rotation(vector: FloatArray) -> FloatArray:
    """Return the rotation matrix of a rotation vector [rad] (Rodrigues), shape (3, 3)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return np.asarray(turn, dtype=float)


def lens_numbers(config: CameraConfig) -> FloatArray:
    """Return pose, lens and window as one flat array for the kernels, shape (LENS_SIZE,).

    Axes by rows (9), position (3), focal, centre (2), distortion (5), offsets (2), binning,
    supersampling.
    """
    window = config.window
    return np.concatenate(
        [
            axes(config).T.ravel(),
            config.position,
            [config.focal, *config.centre],
            config.distortion,
            [window.x_offset, window.y_offset, window.binning, config.supersampling],
        ]
    )


@compiled
def project(
    lens: FloatArray, x: float, y: float, z: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return column and row on the sample grid of the window and the inverse depth [1/m]."""
    dx, dy, dz = x - lens[9], y - lens[10], z - lens[11]
    depth = lens[6] * dx + lens[7] * dy + lens[8] * dz
    if depth <= 1.0e-6:
        return 0.0, 0.0, -1.0
    a = (lens[0] * dx + lens[1] * dy + lens[2] * dz) / depth
    b = (lens[3] * dx + lens[4] * dy + lens[5] * dz) / depth
    q = a * a + b * b
    radial = 1.0 + q * (lens[15] + q * (lens[16] + q * lens[19]))
    u = a * radial + 2.0 * lens[17] * a * b + lens[18] * (q + 2.0 * a * a)
    v = b * radial + lens[17] * (q + 2.0 * b * b) + 2.0 * lens[18] * a * b
    scale = lens[23] / lens[22]
    column = (lens[12] * u + lens[13] - lens[20] + 0.5) * scale - 0.5
    row = (lens[12] * v + lens[14] - lens[21] + 0.5) * scale - 0.5
    return column, row, 1.0 / depth


def project_points(config: CameraConfig, points: FloatArray) -> FloatArray:
    """Return the pixels of the delivered image that lab points fall on.

    Args:
        config: The camera.
        points: Lab coordinates [m], shape (n, 3).

    Returns:
        Column and row with pixel centres at whole numbers, shape (n, 2); nan behind the camera.
    """
    lens = lens_numbers(config)
    lens[23] = 1.0
    pixels = np.full((len(points), 2), np.nan)
    for index, (x, y, z) in enumerate(points):
        column, row, inverse = project(lens, x, y, z)
        if inverse > 0.0:
            pixels[index] = column, row
    return pixels


def sample_rays(config: CameraConfig, first: int, last: int) -> FloatArray:
    """Return the direction of every sample of some rows of the window, in the lab frame.

    Args:
        config: The camera.
        first: First row of the delivered image.
        last: Row after the last.

    Returns:
        Directions with unit depth, shape ((last - first) * s, columns * s, 3), s the
        supersampling.

    Raises:
        ValueError: The distortion cannot be inverted over these rows.
    """
    _, columns = config.window.shape
    s = config.supersampling
    step = config.window.binning / s
    u = config.window.x_offset - 0.5 + (np.arange(columns * s) + 0.5) * step
    v = config.window.y_offset - 0.5 + (np.arange(first * s, last * s) + 0.5) * step
    plane, worst = _undistorted(
        lens_numbers(config),
        np.asarray((u - config.centre[0]) / config.focal, dtype=float),
        np.asarray((v - config.centre[1]) / config.focal, dtype=float),
    )
    if not worst < INVERSION_TOLERANCE:
        raise ValueError(f"distortion {config.distortion} cannot be inverted over the window")
    camera = np.concatenate([plane, np.ones((*plane.shape[:2], 1))], axis=-1)
    return np.asarray(camera @ axes(config).T, dtype=float)


@compiled
def _undistorted(
    lens: FloatArray, across: FloatArray, down: FloatArray
) -> tuple[FloatArray, float]:  # pragma: no cover
    """Return undistorted plane coordinates of a grid, by fixed point, and the worst residual."""
    plane = np.empty((down.size, across.size, 2))
    worst = 0.0
    for row in range(down.size):
        a, b = across[0], down[row]
        for column in range(across.size):
            residual = math.inf
            # The last pixel's answer is the best guess for the next one.
            for _ in range(INVERSION_STEPS):
                q = a * a + b * b
                radial = 1.0 + q * (lens[15] + q * (lens[16] + q * lens[19]))
                shift_a = 2.0 * lens[17] * a * b + lens[18] * (q + 2.0 * a * a)
                shift_b = lens[17] * (q + 2.0 * b * b) + 2.0 * lens[18] * a * b
                residual = max(
                    abs(a * radial + shift_a - across[column]),
                    abs(b * radial + shift_b - down[row]),
                )
                if not residual > 0.1 * INVERSION_TOLERANCE:
                    break
                a, b = (across[column] - shift_a) / radial, (down[row] - shift_b) / radial
            if not residual <= worst:
                worst = residual
            plane[row, column, 0], plane[row, column, 1] = a, b
    return plane, worst


def distort(config: CameraConfig, plane: FloatArray) -> FloatArray:
    """Return distorted coordinates of the image plane, shape (..., 2)."""
    k1, k2, p1, p2, k3 = config.distortion
    a, b = plane[..., 0], plane[..., 1]
    q = a * a + b * b
    radial = 1.0 + q * (k1 + q * (k2 + q * k3))
    return np.stack(
        [
            a * radial + 2.0 * p1 * a * b + p2 * (q + 2.0 * a * a),
            b * radial + p1 * (q + 2.0 * b * b) + 2.0 * p2 * a * b,
        ],
        axis=-1,
    )
