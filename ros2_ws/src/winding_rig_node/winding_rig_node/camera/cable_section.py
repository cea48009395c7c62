"""Cross-sections of the cable: the lit and projected half of the rim that faces the camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import compiled
from winding_rig_node.camera.cable_path import PathTable, path_height
from winding_rig_node.camera.optics import Lens, project
from winding_rig_node.camera.raster import Corner
from winding_rig_node.camera.sight import HIDDEN_COSINE

FloatArray = NDArray[np.float64]

FACETS = 10


class Cable(NamedTuple):
    """The cable at one instant; see `Scene`.

    Attributes:
        cylinder_radius: R [m].
        cable_radius: r [m].
        turned: Cylinder angle Theta [rad].
        guide_z: [m]
        free_length: [m]
        tail: Cable behind P0 [rad].
        band_width: Of a marker along the cable [m].
        path: Where it lies on the cylinder.
        markers: Wound angles [rad], nan for none.
        step: Largest angle between sections [rad].
    """

    cylinder_radius: float
    cable_radius: float
    turned: float
    guide_z: float
    free_length: float
    tail: float
    band_width: float
    path: PathTable
    markers: FloatArray
    step: float


class Lighting(NamedTuple):
    """Unit direction towards the lamp, share of ambient light and highlight over half-angle.

    Attributes:
        x: Of the direction.
        y: Of the direction.
        z: Of the direction.
        ambient: Share of the light without a direction.
        gloss: Highlight at equal steps of the half-angle's cosine from 0 to 1, shape (n,).
    """

    x: float
    y: float
    z: float
    ambient: float
    gloss: FloatArray


class Bounds(NamedTuple):
    """Columns and rows of the sample grid, and the room around it for a section [samples]."""

    columns: float
    rows: float
    room: float


class View(NamedTuple):
    """The cable before the camera; landing_z is where it lands [m]."""

    lens: Lens
    cable: Cable
    light: Lighting
    bounds: Bounds
    landing_z: float


class Rim(NamedTuple):
    """Corners around a cross-section, arrays of shape (FACETS + 1,); see `Corner`."""

    column: FloatArray
    row: FloatArray
    inverse_depth: FloatArray
    shade: FloatArray
    gloss: FloatArray


@compiled
def empty_rim() -> Rim:  # pragma: no cover
    """Return room for the corners of one cross-section."""
    size = FACETS + 1
    return Rim(np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size))


@compiled
def corner(rim: Rim, k: int) -> Corner:  # pragma: no cover
    """Return corner k of a cross-section."""
    return Corner(rim.column[k], rim.row[k], rim.inverse_depth[k], rim.shade[k], rim.gloss[k])


@compiled
def span_slope(view: View) -> float:  # pragma: no cover
    """Return dz per way towards the guide of the free span."""
    return (view.cable.guide_z - view.landing_z) / view.cable.free_length


@compiled
def section(view: View, theta: float, out: Rim) -> bool:  # pragma: no cover
    """Write the projected rim of the section at a wound angle [rad]; return if it can be seen."""
    lens, cable, light, bounds = view.lens, view.cable, view.light, view.bounds
    r = cable.cable_radius
    rho = cable.cylinder_radius + r
    way = rho * (theta - cable.turned)
    if way > 0.0:
        slope = span_slope(view)
        cx, cy, cz = rho, -way, view.landing_z + slope * way
        ex, ey = 1.0, 0.0
        tx, ty, tz = 0.0, -1.0, slope
    else:
        azimuth = cable.turned - theta
        ex, ey = math.cos(azimuth), math.sin(azimuth)
        if ex < HIDDEN_COSINE:
            return False
        cz, slope = path_height(cable.path, theta)
        cx, cy = rho * ex, rho * ey
        tx, ty, tz = ey, -ex, slope / rho
    column, row, inverse = project(lens, cx, cy, cz)
    room = bounds.room
    if (
        inverse <= 0.0
        or not -room < column < bounds.columns + room
        or not -room < row < bounds.rows + room
    ):
        return False
    norm = 1.0 / math.sqrt(1.0 + tz * tz)
    tx, ty, tz = tx * norm, ty * norm, tz * norm
    bx, by, bz = -tz * ey, tz * ex, tx * ey - ty * ex
    vx, vy, vz = lens.x - cx, lens.y - cy, lens.z - cz
    along_e, along_b = vx * ex + vy * ey, vx * bx + vy * by + vz * bz
    distance = math.sqrt(along_e * along_e + along_b * along_b)
    # Seen from a distance d the rim of a circle of radius r lies at acos(r / d), not at 90 degrees.
    reach_cosine = min(r / distance, 1.0)
    reach_sine = math.sqrt(1.0 - reach_cosine * reach_cosine)
    facet = 2.0 * math.acos(reach_cosine) / FACETS
    facet_cosine, facet_sine = math.cos(facet), math.sin(facet)
    # Facets are chords: corners lie outside by as much as middles lie inside, so that the mean
    # distance is r. The rim itself is exact.
    inner = r / (1.0 - facet * facet / 12.0)
    c = (along_e * reach_cosine + along_b * reach_sine) / distance
    s = (along_b * reach_cosine - along_e * reach_sine) / distance
    for k in range(FACETS + 1):
        nx, ny, nz = c * ex + s * bx, c * ey + s * by, s * bz
        c, s = c * facet_cosine - s * facet_sine, s * facet_cosine + c * facet_sine
        reached = r if k in (0, FACETS) else inner
        px, py, pz = cx + reached * nx, cy + reached * ny, cz + reached * nz
        out.column[k], out.row[k], out.inverse_depth[k] = project(lens, px, py, pz)
        diffuse = nx * light.x + ny * light.y + nz * light.z
        out.shade[k] = light.ambient + (1.0 - light.ambient) * max(diffuse, 0.0)
        wx, wy, wz = lens.x - px, lens.y - py, lens.z - pz
        scale = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
        # Both directions are unit vectors: the square of their sum is twice 1 plus their product.
        between = (wx * light.x + wy * light.y + wz * light.z) * scale
        towards = (nx * wx + ny * wy + nz * wz) * scale
        half = (diffuse + towards) / math.sqrt(max(2.0 + 2.0 * between, 1.0e-12))
        out.gloss[k] = _highlight(light.gloss, half)
    return True


@compiled
def _highlight(gloss: FloatArray, cosine: float) -> float:  # pragma: no cover
    """Return the highlight at a cosine of the half-angle, linear between those of the table."""
    place = min(max(cosine, 0.0), 1.0) * (gloss.size - 1)
    index = min(int(place), gloss.size - 2)
    return gloss[index] + (place - index) * (gloss[index + 1] - gloss[index])
