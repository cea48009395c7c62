"""Cross-sections of the cable: the lit and projected half of the rim that faces the camera."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called
from winding_rig_node.camera.cable_path import path_height
from winding_rig_node.camera.optics import HIDDEN_COSINE, Lens, project
from winding_rig_node.camera.raster import COLUMN, GLOSS, NEAR, ROW, SHADE

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

FACETS = 10


class Cable(NamedTuple):
    """The cable at one instant; see `Scene`."""

    cylinder_radius: float  # R [m]
    cable_radius: float  # r [m]
    turned: float  # Cylinder angle Theta [rad]
    landing_z: float  # Where it lands [m]
    landing_lift: float  # How high it lands on other turns [m]
    guide_z: float  # [m]
    free_length: float  # [m]
    tail: float  # Cable behind P0 [rad]
    band_width: float  # Of a marker along the cable [m]
    step: float  # Largest angle between sections [rad]


class Lighting(NamedTuple):
    """Unit direction towards the lamp, and share of the light without a direction."""

    x: float
    y: float
    z: float
    ambient: float


class Bounds(NamedTuple):
    """Columns and rows of the sample grid, and the room around it for a section [samples]."""

    columns: float
    rows: float
    room: float


class View(NamedTuple):
    """The cable before the camera."""

    lens: Lens
    cable: Cable
    light: Lighting
    bounds: Bounds


class Place(NamedTuple):
    """A point of the centre line."""

    x: float  # [m]
    y: float  # [m]
    z: float  # [m]
    out_x: float  # Of the unit vector away from the cylinder's axis
    out_y: float  # Of the unit vector away from the cylinder's axis
    rise: float  # dz per way along the cylinder's circumference, towards the guide


@called
def span_rise(cable: Cable) -> float:  # pragma: no cover
    """Return dz per way towards the guide of the free span."""
    return (cable.guide_z - cable.landing_z) / cable.free_length


@called
def centre_line(
    cable: Cable,
    grid: FloatArray,
    heights: FloatArray,
    lifts: FloatArray,
    first: IndexArray,
    theta: float,
) -> Place:  # pragma: no cover
    """Return where the centre line runs at a wound angle [rad]; for the arrays see `PathTable`."""
    rho = cable.cylinder_radius + cable.cable_radius
    azimuth = cable.turned - theta
    if azimuth < 0.0:
        way, rise = -rho * azimuth, span_rise(cable)
        return Place(rho + cable.landing_lift, -way, cable.landing_z + rise * way, 1.0, 0.0, rise)
    z, slope, lift = path_height(grid, heights, lifts, first, theta)
    rho += lift
    c, s = math.cos(azimuth), math.sin(azimuth)
    return Place(rho * c, rho * s, z, c, s, slope / rho)


@called
def section(
    view: View, gloss: FloatArray, place: Place, rims: FloatArray, which: int
) -> bool:  # pragma: no cover
    """Write the rim of the section at a point of the centre line; return whether it can be seen.

    Args:
        view: The cable before the camera.
        gloss: Highlight at equal steps of the half-angle's cosine from 0 to 1, shape (n,).
        place: Of the section.
        rims: Room for sections, corners around the half that faces the camera in the order of
            `raster`, shape (sections, FACETS + 1, 5).
        which: Of these sections is written.
    """
    lens, light, bounds = view.lens, view.light, view.bounds
    r = view.cable.cable_radius
    cx, cy, cz, ex, ey = place.x, place.y, place.z, place.out_x, place.out_y
    if ex < HIDDEN_COSINE:
        return False
    column, row, inverse = project(lens, cx, cy, cz)
    room = bounds.room
    if (
        inverse <= 0.0
        or not -room < column < bounds.columns + room
        or not -room < row < bounds.rows + room
    ):
        return False
    norm = 1.0 / math.sqrt(1.0 + place.rise * place.rise)
    tx, ty, tz = ey * norm, -ex * norm, place.rise * norm
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
        rims[which, k, COLUMN], rims[which, k, ROW], rims[which, k, NEAR] = project(
            lens, px, py, pz
        )
        diffuse = nx * light.x + ny * light.y + nz * light.z
        rims[which, k, SHADE] = light.ambient + (1.0 - light.ambient) * max(diffuse, 0.0)
        wx, wy, wz = lens.x - px, lens.y - py, lens.z - pz
        scale = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
        # Both directions are unit vectors: the square of their sum is twice 1 plus their product.
        between = (wx * light.x + wy * light.y + wz * light.z) * scale
        towards = (nx * wx + ny * wy + nz * wz) * scale
        half = (diffuse + towards) / math.sqrt(max(2.0 + 2.0 * between, 1.0e-12))
        rims[which, k, GLOSS] = highlight(gloss, half)
    return True


@called
def highlight(gloss: FloatArray, cosine: float) -> float:  # pragma: no cover
    """Return the highlight at a cosine (dimensionless) of the half-angle, linear in the table."""
    place = min(max(cosine, 0.0), 1.0) * (gloss.size - 1)
    index = min(int(place), gloss.size - 2)
    low, high = gloss[index], gloss[index + 1]
    return float(low + (place - index) * (high - low))
