"""Dots: squares printed on the outside of the cable, drawn onto the samples that show it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called, compiled
from winding_rig_node.camera.cable_path import PathTable
from winding_rig_node.camera.cable_section import Cable, Lighting, centre_line, highlight
from winding_rig_node.camera.optics import Lens, project
from winding_rig_node.camera.raster import Point, Samples, fill_triangle, touch

FloatArray = NDArray[np.float64]

PARTS = 8  # Squares of a dot in either direction: chords stay within 0.2 % of the cable's radius
# Facets of the cable lie up to 1 % of its radius before the surface: a dot is not hidden by those
# that it is printed on.
PRINT_DEPTH = 2.0e-4


class Dots(NamedTuple):
    """Printed squares."""

    theta: FloatArray  # Wound angles of their middles [rad], nan for none, shape (n,)
    torsion: FloatArray  # Angle around the section from outside towards +z [rad], shape (n,)
    size: float  # Side [m]


@compiled
def draw_dots(
    lens: Lens,
    light: Lighting,
    gloss: FloatArray,
    cable: Cable,
    path: PathTable,
    dots: Dots,
    samples: Samples,
) -> None:  # pragma: no cover
    """Draw dots (label 2 + n) where they lie before what was drawn.

    Args:
        lens: The camera.
        light: On the cable.
        gloss: See `section`.
        cable: With the dots.
        path: Where it lies on the cylinder.
        dots: To be drawn.
        samples: To be written.
    """
    for n in range(dots.theta.size):
        if not math.isfinite(dots.theta[n]):
            continue
        for i in range(PARTS):
            for j in range(PARTS):
                a = _corner(lens, light, gloss, cable, path, dots, n, i, j)
                b = _corner(lens, light, gloss, cable, path, dots, n, i + 1, j)
                c = _corner(lens, light, gloss, cable, path, dots, n, i, j + 1)
                d = _corner(lens, light, gloss, cable, path, dots, n, i + 1, j + 1)
                if a.near <= 0.0 or b.near <= 0.0 or c.near <= 0.0 or d.near <= 0.0:
                    continue
                _fill(a, b, c, d, 2 + n, samples)


@called
def _corner(
    lens: Lens,
    light: Lighting,
    gloss: FloatArray,
    cable: Cable,
    path: PathTable,
    dots: Dots,
    n: int,
    i: int,
    j: int,
) -> Point:  # pragma: no cover
    """Return a corner of the squares of dot n; not near where it faces away from the camera."""
    rho, r = cable.cylinder_radius + cable.cable_radius, cable.cable_radius
    middle = centre_line(cable, path.theta, path.z, path.lift, path.first, dots.theta[n])
    way = (i / PARTS - 0.5) * dots.size / (rho * math.hypot(1.0, middle.rise))
    place = centre_line(cable, path.theta, path.z, path.lift, path.first, dots.theta[n] + way)
    psi = dots.torsion[n] + (j / PARTS - 0.5) * dots.size / r
    ex, ey = place.out_x, place.out_y
    norm = 1.0 / math.sqrt(1.0 + place.rise * place.rise)
    tx, ty, tz = ey * norm, -ex * norm, place.rise * norm
    bx, by, bz = -tz * ey, tz * ex, tx * ey - ty * ex
    c, s = math.cos(psi), math.sin(psi)
    nx, ny, nz = c * ex + s * bx, c * ey + s * by, s * bz
    px, py, pz = place.x + r * nx, place.y + r * ny, place.z + r * nz
    wx, wy, wz = lens.x - px, lens.y - py, lens.z - pz
    facing = nx * wx + ny * wy + nz * wz
    column, row, near = project(lens, px, py, pz)
    scale = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
    diffuse = nx * light.x + ny * light.y + nz * light.z
    between = (wx * light.x + wy * light.y + wz * light.z) * scale
    half = (diffuse + facing * scale) / math.sqrt(max(2.0 + 2.0 * between, 1.0e-12))
    return Point(
        column,
        near / (1.0 - PRINT_DEPTH * near) if facing > 0.0 else -1.0,
        light.ambient + (1.0 - light.ambient) * max(diffuse, 0.0),
        highlight(gloss, half),
        row,
    )


@called
def _fill(
    a: Point, b: Point, c: Point, d: Point, value: int, samples: Samples
) -> None:  # pragma: no cover
    """Write one square of a dot."""
    rows, columns = samples.seen.shape[:2]
    left = max(math.floor(min(a.column, b.column, c.column, d.column)), 0)
    right = min(math.floor(max(a.column, b.column, c.column, d.column)), columns - 1)
    top = max(math.floor(min(a.row, b.row, c.row, d.row)), 0)
    bottom = min(math.floor(max(a.row, b.row, c.row, d.row)), rows - 1)
    if left > right:
        return
    for row in range(top, bottom + 1):
        touch(samples.touched, row, left, right, samples.per_pixel)
    fill_triangle(a, b, c, value, samples.seen)
    fill_triangle(c, b, d, value, samples.seen)
