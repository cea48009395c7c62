"""A second, independent way to draw a scene: OpenCV projects facets and fills polygons.

It shares neither projection nor rasteriser with `Renderer`. It is slow and knows neither noise
nor highlights; it exists so that one can be checked against the other.
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.scene import Colour, Scene

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

FACETS = 32
TURN_STEP = 0.04
OVERSAMPLING = 12
SUBPIXEL_BITS = 4


def draw_polygons(config: CameraConfig, scene: Scene) -> ByteArray:
    """Return the frame of a scene drawn far to near, uint8 of shape (rows, columns, 3)."""
    quads, colours = _cable_quads(scene)
    hidden, grey = _cylinder_quads(scene)
    corners = np.concatenate([quads, hidden])
    paint = np.concatenate([colours, grey])
    order = np.argsort(-_distance(config, corners.mean(axis=1)))
    rows, columns = config.window.shape
    canvas = np.empty((rows * OVERSAMPLING, columns * OVERSAMPLING, 3), dtype=np.uint8)
    canvas[:] = np.round(scene.paint.backdrop)
    pixels = _pixels(config, corners.reshape(-1, 3)).reshape(-1, 4, 2)
    fixed = np.round(pixels * (1 << SUBPIXEL_BITS)).astype(np.int32)
    facing = _facing(config, corners)
    for index in order:
        if facing[index]:
            colour = tuple(float(value) for value in paint[index])
            cv2.fillConvexPoly(canvas, fixed[index], colour, cv2.LINE_8, SUBPIXEL_BITS)
    return np.asarray(
        cv2.resize(canvas, (columns, rows), interpolation=cv2.INTER_AREA), dtype=np.uint8
    )


def _pixels(config: CameraConfig, points: FloatArray) -> FloatArray:
    """Project lab points onto the oversampled window."""
    nominal = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    turned = cv2.Rodrigues(np.array(config.tilt))[0].T @ nominal
    shift = -turned @ np.array(config.position)
    fx, (cx, cy) = config.focal, config.centre
    matrix = np.array([[fx, 0.0, cx], [0.0, fx, cy], [0.0, 0.0, 1.0]])
    full, _ = cv2.projectPoints(
        points, cv2.Rodrigues(turned)[0], shift, matrix, np.array(config.distortion)
    )
    window = config.window
    full = full.reshape(-1, 2) - np.array([window.x_offset, window.y_offset])
    return np.asarray((full + 0.5) * OVERSAMPLING / window.binning - 0.5, dtype=float)


def _distance(config: CameraConfig, points: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points - np.array(config.position), axis=1), dtype=float)


def _facing(config: CameraConfig, corners: FloatArray) -> NDArray[np.bool_]:
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    towards = np.array(config.position) - corners.mean(axis=1)
    return np.asarray((normal * towards).sum(axis=1) > 0.0, dtype=bool)


def _tube_rings(scene: Scene, theta: FloatArray) -> FloatArray:
    """Return points around the cable at wound angles, shape (n, FACETS, 3)."""
    small = 1.0e-6
    centre = scene.centreline(theta)
    ahead, behind = scene.centreline(theta + small), scene.centreline(theta - small)
    tangent = ahead - behind
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    azimuth = np.maximum(scene.cylinder_angle - theta, 0.0)
    outward = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=1)
    outward -= (outward * tangent).sum(axis=1)[:, None] * tangent
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    sideways = np.cross(tangent, outward)
    psi = np.arange(FACETS) * 2.0 * math.pi / FACETS
    # Facets that enclose the circle's area, not its chords.
    radius = scene.cable_radius / math.sqrt(math.sin(2.0 * math.pi / FACETS) * FACETS / math.tau)
    ring = (
        np.cos(psi)[None, :, None] * outward[:, None]
        + np.sin(psi)[None, :, None] * (sideways[:, None])
    )
    return np.asarray(centre[:, None] + radius * ring, dtype=float)


def _cable_quads(scene: Scene) -> tuple[FloatArray, FloatArray]:
    rho = scene.centreline_radius
    end = scene.cylinder_angle + scene.free_length / rho
    theta = np.linspace(-scene.tail_angle, end, math.ceil((end + scene.tail_angle) / TURN_STEP) + 1)
    bands: list[tuple[float, float]] = []
    for centre in scene.marker_theta[np.isfinite(scene.marker_theta)]:
        around = scene.centreline(np.array([centre - 1.0e-4, centre + 1.0e-4]))
        way = float(np.linalg.norm(around[1] - around[0])) / 2.0e-4
        half = 0.5 * scene.band_width / way
        bands.append((centre - half, centre + half))
        theta = np.union1d(theta, np.linspace(centre - half, centre + half, 9))
    theta = np.union1d(theta, [scene.cylinder_angle])
    theta = theta[(theta >= -scene.tail_angle) & (theta <= end)]
    rings = _tube_rings(scene, theta)
    middle = 0.5 * (theta[1:] + theta[:-1])
    marked = np.zeros(middle.size, dtype=bool)
    for first, last in bands:
        marked |= (middle > first) & (middle < last)
    flat = np.where(marked[:, None], scene.paint.marker, scene.paint.cable)
    after = np.roll(rings, -1, axis=1)
    quads = np.stack([rings[:-1], after[:-1], after[1:], rings[1:]], axis=2)
    return quads.reshape(-1, 4, 3), np.repeat(flat, FACETS, axis=0)


def _cylinder_quads(scene: Scene) -> tuple[FloatArray, FloatArray]:
    angle = np.linspace(0.0, 2.0 * math.pi, 181)
    z = np.linspace(*scene.cylinder_ends, 41)
    # A hair inside, so that facets of the cable that lie on the surface come after it.
    radius = 0.97 * scene.cylinder_radius
    x, y = radius * np.cos(angle), radius * np.sin(angle)

    def corner(i: slice, k: slice) -> FloatArray:
        a, b = np.meshgrid(x[i], z[k], indexing="ij")
        c, _ = np.meshgrid(y[i], z[k], indexing="ij")
        return np.stack([a, c, b], axis=-1).reshape(-1, 3)

    low, high = slice(None, -1), slice(1, None)
    quads = np.stack(
        [corner(low, low), corner(high, low), corner(high, high), corner(low, high)], axis=1
    )
    colour: Colour = scene.paint.cylinder
    return quads, np.tile(np.array(colour), (len(quads), 1))
