"""Pinhole with Brown-Conrady distortion, for points and for rays, and what its window can show."""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called, compiled
from winding_rig_node.camera.config import NOMINAL_AXES, CameraConfig

FloatArray = NDArray[np.float64]

INVERSION_STEPS = 200
INVERSION_TOLERANCE = 1.0e-11


class Lens(NamedTuple):
    """Pose, lens and window as the kernels take them.

    Right, down and forward are the camera's axes in the lab frame, x, y, z its centre [m], focal
    and centre its focal length and principal point on the window's sample grid [samples], k1 to
    k3 and p1, p2 the Brown-Conrady distortion.
    """

    right_x: float
    right_y: float
    right_z: float
    down_x: float
    down_y: float
    down_z: float
    forward_x: float
    forward_y: float
    forward_z: float
    x: float
    y: float
    z: float
    focal: float
    centre_column: float
    centre_row: float
    k1: float
    k2: float
    p1: float
    p2: float
    k3: float


def axes(config: CameraConfig) -> FloatArray:
    """Return the camera's x, y and z axes in the lab frame as columns, shape (3, 3)."""
    turn, _ = cv2.Rodrigues(np.array(config.tilt))
    return np.asarray(NOMINAL_AXES @ turn, dtype=float)


def lens_of(config: CameraConfig, per_pixel: int) -> Lens:
    """Return pose, lens and window of a camera for the kernels.

    Args:
        config: The camera.
        per_pixel: Samples per pixel of the delivered image and direction.
    """
    window = config.window
    scale = per_pixel / window.binning
    corner = window.x_offset, window.y_offset
    return Lens._make(
        float(number)
        for number in (
            *axes(config).T.ravel(),
            *config.position,
            config.focal * scale,
            *(
                (middle - offset + 0.5) * scale - 0.5
                for middle, offset in zip(config.centre, corner, strict=True)
            ),
            *config.distortion,
        )
    )


@compiled
def project(
    lens: Lens, x: float, y: float, z: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return column and row on the sample grid of the window and the inverse depth [1/m]."""
    dx, dy, dz = x - lens.x, y - lens.y, z - lens.z
    depth = lens.forward_x * dx + lens.forward_y * dy + lens.forward_z * dz
    if depth <= 1.0e-6:
        return 0.0, 0.0, -1.0
    inverse = 1.0 / depth
    a = (lens.right_x * dx + lens.right_y * dy + lens.right_z * dz) * inverse
    b = (lens.down_x * dx + lens.down_y * dy + lens.down_z * dz) * inverse
    q = a * a + b * b
    radial = 1.0 + q * (lens.k1 + q * (lens.k2 + q * lens.k3))
    u = a * radial + 2.0 * lens.p1 * a * b + lens.p2 * (q + 2.0 * a * a)
    v = b * radial + lens.p1 * (q + 2.0 * b * b) + 2.0 * lens.p2 * a * b
    return lens.focal * u + lens.centre_column, lens.focal * v + lens.centre_row, inverse


def project_points(config: CameraConfig, points: FloatArray) -> FloatArray:
    """Return the pixels of the delivered image that lab points fall on.

    Args:
        config: The camera.
        points: Lab coordinates [m], shape (n, 3).

    Returns:
        Column and row with pixel centres at whole numbers, shape (n, 2); nan behind the camera.
    """
    lens = lens_of(config, 1)
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
        lens_of(config, s),
        np.asarray((u - config.centre[0]) / config.focal, dtype=float),
        np.asarray((v - config.centre[1]) / config.focal, dtype=float),
    )
    if not worst < INVERSION_TOLERANCE:
        raise ValueError(f"distortion {config.distortion} cannot be inverted over the window")
    camera = np.concatenate([plane, np.ones((*plane.shape[:2], 1))], axis=-1)
    return np.asarray(camera @ axes(config).T, dtype=float)


@compiled
def _undistorted(
    lens: Lens, across: FloatArray, down: FloatArray
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
                radial = 1.0 + q * (lens.k1 + q * (lens.k2 + q * lens.k3))
                shift_a = 2.0 * lens.p1 * a * b + lens.p2 * (q + 2.0 * a * a)
                shift_b = lens.p1 * (q + 2.0 * b * b) + 2.0 * lens.p2 * a * b
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


HIDDEN_COSINE = -0.25  # A section whose azimuth has a smaller cosine stands behind the cylinder


class RayRange(NamedTuple):
    """Least and greatest dy/dx and dz/dx of the rays through the window, in the lab frame."""

    y_low: float
    y_high: float
    z_low: float
    z_high: float


class Sight(NamedTuple):
    """Where the centre line must run to show in the window."""

    first_azimuth: float  # On the cylinder [rad]
    last_azimuth: float  # On the cylinder [rad]
    y_low: float  # On the free span [m]
    y_high: float  # On the free span [m]
    z_low: float  # [m]
    z_high: float  # [m]


@called
def sight_of(lens: Lens, rays: RayRange, rho: float, room: float) -> Sight:  # pragma: no cover
    """Return where a centre line at the radius rho [m] can show.

    Args:
        lens: The camera.
        rays: Through its window.
        rho: Radius of the centre line [m].
        room: Farthest that what is drawn of a section lies from the centre line [m].
    """
    back, front = lens.x - rho * HIDDEN_COSINE + room, lens.x - rho - room
    y_low, y_high = -math.inf, math.inf
    z_low, z_high = -math.inf, math.inf
    if front > 0.0:
        # Rays run towards -x: what they gain per metre towards the cable is minus the slope.
        y_low = lens.y - max(front * rays.y_high, back * rays.y_high) - room
        y_high = lens.y - min(front * rays.y_low, back * rays.y_low) + room
        z_low = lens.z - max(front * rays.z_high, back * rays.z_high) - room
        z_high = lens.z - min(front * rays.z_low, back * rays.z_low) + room
    hidden = math.acos(HIDDEN_COSINE)
    first, last = -hidden, hidden
    # Beyond a quarter turn y falls again: a part that comes back before it is hidden counts.
    if rho * math.sin(hidden) > y_high > -rho:
        last = math.asin(y_high / rho)
    if -rho * math.sin(hidden) < y_low < rho:
        first = math.asin(y_low / rho)
    return Sight(first, last, y_low, y_high, z_low, z_high)
