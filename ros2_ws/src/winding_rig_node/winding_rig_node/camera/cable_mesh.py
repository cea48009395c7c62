"""The cable as strips of facets between cross-sections, only the half that faces the camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import compiled
from winding_rig_node.camera.optics import Lens, project
from winding_rig_node.camera.raster import Corner, Samples, fill_triangle

FloatArray = NDArray[np.float64]

FACETS = 10
HIDDEN_COSINE = -0.25


class Cable(NamedTuple):
    """The cable at one instant; see `Scene`.

    Attributes:
        cylinder_radius: R [m].
        cable_radius: r [m].
        turned: Cylinder angle Theta [rad].
        landing_z: Where the cable lands [m].
        guide_z: [m]
        free_length: [m]
        tail: Cable behind P0 [rad].
        path_theta: Path angles [rad].
        path_z: Path heights [m].
        markers: Wound angles [rad], nan for none.
        half_bands: Half of each band as wound angle [rad].
        step: Largest angle between sections [rad].
    """

    cylinder_radius: float
    cable_radius: float
    turned: float
    landing_z: float
    guide_z: float
    free_length: float
    tail: float
    path_theta: FloatArray
    path_z: FloatArray
    markers: FloatArray
    half_bands: FloatArray
    step: float


class Lighting(NamedTuple):
    """Unit direction towards the lamp, share of ambient light, strength and exponent of gloss."""

    x: float
    y: float
    z: float
    ambient: float
    highlight: float
    exponent: float


class Bounds(NamedTuple):
    """Columns and rows of the sample grid, and the room around it for a section [samples]."""

    columns: float
    rows: float
    room: float


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
def path_height(
    grid: FloatArray, height: FloatArray, theta: float
) -> tuple[float, float]:  # pragma: no cover
    """Return z [m] and dz/dtheta [m/rad] of a piecewise linear path, level outside its grid."""
    last = grid.size - 1
    if theta <= grid[0]:
        return height[0], 0.0
    if theta >= grid[last]:
        return height[last], 0.0
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if grid[middle] <= theta:
            low = middle
        else:
            high = middle
    slope = (height[high] - height[low]) / (grid[high] - grid[low])
    return height[low] + slope * (theta - grid[low]), slope


@compiled
def breaks(
    start: float, landing: float, end: float, markers: FloatArray, half_band: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return the sorted wound angles [rad] where the cable changes: ends, landing, band edges."""
    edges = np.empty(3 + 2 * markers.size)
    edges[0], edges[1], edges[2] = start, min(max(landing, start), end), end
    for n in range(markers.size):
        centre, half = markers[n], half_band[n]
        if not math.isfinite(centre):
            centre, half = start, 0.0
        edges[3 + 2 * n] = min(max(centre - half, start), end)
        edges[4 + 2 * n] = min(max(centre + half, start), end)
    edges.sort()
    return edges


@compiled
def section(
    lens: Lens, cable: Cable, light: Lighting, bounds: Bounds, theta: float, out: Rim
) -> bool:  # pragma: no cover
    """Write the projected rim of the section at a wound angle [rad]; return if it can be seen."""
    r = cable.cable_radius
    rho = cable.cylinder_radius + r
    way = rho * (theta - cable.turned)
    if way > 0.0:
        slope = (cable.guide_z - cable.landing_z) / cable.free_length
        cx, cy, cz = rho, -way, cable.landing_z + slope * way
        ex, ey = 1.0, 0.0
        tx, ty, tz = 0.0, -1.0, slope
    else:
        azimuth = cable.turned - theta
        ex, ey = math.cos(azimuth), math.sin(azimuth)
        if ex < HIDDEN_COSINE:
            return False
        cz, slope = path_height(cable.path_theta, cable.path_z, theta)
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
    norm = math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx / norm, ty / norm, tz / norm
    bx, by, bz = ty * 0.0 - tz * ey, tz * ex - tx * 0.0, tx * ey - ty * ex
    vx, vy, vz = lens.x - cx, lens.y - cy, lens.z - cz
    along_e, along_b = vx * ex + vy * ey, vx * bx + vy * by + vz * bz
    facing = math.atan2(along_b, along_e)
    # Seen from a distance d the rim of a circle of radius r lies at acos(r / d), not at 90 degrees.
    reach = math.acos(min(r / math.hypot(along_e, along_b), 1.0))
    # Facets are chords: corners lie outside by as much as middles lie inside, so that the mean
    # distance is r. The rim itself is exact.
    inner = r / (1.0 - (reach / FACETS) ** 2 / 3.0)
    for k in range(FACETS + 1):
        psi = facing + reach * (2.0 * k / FACETS - 1.0)
        c, s = math.cos(psi), math.sin(psi)
        nx, ny, nz = c * ex + s * bx, c * ey + s * by, s * bz
        reached = r if k in (0, FACETS) else inner
        px, py, pz = cx + reached * nx, cy + reached * ny, cz + reached * nz
        out.column[k], out.row[k], out.inverse_depth[k] = project(lens, px, py, pz)
        diffuse = nx * light.x + ny * light.y + nz * light.z
        out.shade[k] = light.ambient + (1.0 - light.ambient) * max(diffuse, 0.0)
        wx, wy, wz = lens.x - px, lens.y - py, lens.z - pz
        scale = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
        hx, hy, hz = wx * scale + light.x, wy * scale + light.y, wz * scale + light.z
        half = (nx * hx + ny * hy + nz * hz) / math.sqrt(hx * hx + hy * hy + hz * hz)
        glossy = light.highlight > 0.0
        out.gloss[k] = light.highlight * max(half, 0.0) ** light.exponent if glossy else 0.0
    return True


@compiled
def draw_cable(
    lens: Lens, cable: Cable, light: Lighting, samples: Samples
) -> None:  # pragma: no cover
    """Draw cable (label 1) and marker bands (label 2 + n) into samples that hold the cylinder."""
    rho = cable.cylinder_radius + cable.cable_radius
    rows, columns = samples.inverse_depth.shape
    near = abs(lens.x) - cable.cylinder_radius - 2.0 * cable.cable_radius
    grain = lens.focal * lens.supersampling / (lens.binning * near)
    bounds = Bounds(float(columns), float(rows), (cable.cable_radius + cable.step * rho) * grain)
    end = cable.turned + cable.free_length / rho
    edges = breaks(-cable.tail, cable.turned, end, cable.markers, cable.half_bands)
    previous, current = empty_rim(), empty_rim()
    for interval in range(edges.size - 1):
        first, last = edges[interval], edges[interval + 1]
        if last - first <= 0.0:
            continue
        middle = 0.5 * (first + last)
        value = 1
        for n in range(cable.markers.size):
            if abs(middle - cable.markers[n]) < cable.half_bands[n]:
                value = 2 + n
        count = math.ceil((last - first) / cable.step)
        seen = section(lens, cable, light, bounds, first, previous)
        for k in range(1, count + 1):
            theta = first + (last - first) * k / count
            visible = section(lens, cable, light, bounds, theta, current)
            if visible and seen:
                _draw_strip(previous, current, value, samples)
            seen = visible
            previous, current = current, previous


@compiled
def _draw_strip(one: Rim, other: Rim, value: int, samples: Samples) -> None:  # pragma: no cover
    """Draw the facets between two cross-sections."""
    for m in range(FACETS):
        a, b = corner(one, m), corner(one, m + 1)
        c, d = corner(other, m), corner(other, m + 1)
        fill_triangle(a, b, c, value, samples)
        fill_triangle(c, b, d, value, samples)
