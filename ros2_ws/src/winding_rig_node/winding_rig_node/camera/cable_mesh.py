"""The cable as strips of facets between cross-sections, only the half that faces the camera."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.compiled import compiled
from winding_rig_node.camera.optics import project
from winding_rig_node.camera.raster import fill_triangle

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

FACETS = 10
HIDDEN_COSINE = -0.25


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
    lens: FloatArray,
    body: FloatArray,
    grid: FloatArray,
    height: FloatArray,
    light: FloatArray,
    theta: float,
    size: FloatArray,
    out: FloatArray,
) -> bool:  # pragma: no cover
    """Write one cross-section's projected rim and return whether it can be seen.

    Args:
        lens: See `lens_numbers`.
        body: R, r [m], Theta [rad], landing z, guide z, free length [m].
        grid: Path angles [rad].
        height: Path heights [m].
        light: Unit direction (3), ambient, highlight, exponent.
        theta: Wound angle of the section [rad].
        size: Columns and rows of the sample grid and the room around it for a section [samples].
        out: Column, row, inverse depth, shade, gloss of each rim point, shape (FACETS + 1, 5).
    """
    rho, r, turn = body[0] + body[1], body[1], body[2]
    way = rho * (theta - turn)
    if way > 0.0:
        slope = (body[4] - body[3]) / body[5]
        cx, cy, cz = rho, -way, body[3] + slope * way
        ex, ey = 1.0, 0.0
        tx, ty, tz = 0.0, -1.0, slope
    else:
        azimuth = turn - theta
        ex, ey = math.cos(azimuth), math.sin(azimuth)
        if ex < HIDDEN_COSINE:
            return False
        cz, slope = path_height(grid, height, theta)
        cx, cy = rho * ex, rho * ey
        tx, ty, tz = ey, -ex, slope / rho
    column, row, inverse = project(lens, cx, cy, cz)
    room = size[2]
    if inverse <= 0.0 or not (-room < column < size[0] + room and -room < row < size[1] + room):
        return False
    norm = math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx / norm, ty / norm, tz / norm
    bx, by, bz = ty * 0.0 - tz * ey, tz * ex - tx * 0.0, tx * ey - ty * ex
    vx, vy, vz = lens[9] - cx, lens[10] - cy, lens[11] - cz
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
        column, row, inverse = project(lens, px, py, pz)
        diffuse = nx * light[0] + ny * light[1] + nz * light[2]
        shade = light[3] + (1.0 - light[3]) * max(diffuse, 0.0)
        wx, wy, wz = lens[9] - px, lens[10] - py, lens[11] - pz
        scale = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
        hx, hy, hz = wx * scale + light[0], wy * scale + light[1], wz * scale + light[2]
        half = (nx * hx + ny * hy + nz * hz) / math.sqrt(hx * hx + hy * hy + hz * hz)
        gloss = light[4] * max(half, 0.0) ** light[5] if light[4] > 0.0 else 0.0
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = column, row, inverse, shade, gloss
    return True


@compiled
def draw_cable(
    lens: FloatArray,
    body: FloatArray,
    grid: FloatArray,
    height: FloatArray,
    markers: FloatArray,
    half_band: FloatArray,
    tail: float,
    light: FloatArray,
    step: float,
    inverse_depth: SingleArray,
    label: ByteArray,
    shade: SingleArray,
    gloss: SingleArray,
    touched: ByteArray,
) -> None:  # pragma: no cover
    """Draw cable (label 1) and marker bands (label 2 + n) into the sample buffers.

    Args:
        lens: See `lens_numbers`.
        body: R, r [m], Theta [rad], landing z, guide z, free length [m].
        grid: Path angles [rad].
        height: Path heights [m].
        markers: Wound angles [rad], nan for none.
        half_band: Half of each band as wound angle [rad].
        tail: Cable behind P0 [rad].
        light: See `section`.
        step: Largest angle between sections [rad].
        inverse_depth: [1/m], shape (rows, columns) of samples, holds the cylinder.
        label: Same shape, zero where nothing was drawn.
        shade: Same shape.
        gloss: Same shape.
        touched: See `fill_triangle`.
    """
    turn = body[2]
    samples = int(lens[23])
    size = np.empty(3)
    size[0], size[1] = inverse_depth.shape[1], inverse_depth.shape[0]
    grain = lens[12] * lens[23] / (lens[22] * (abs(lens[9]) - body[0] - 2.0 * body[1]))
    size[2] = (body[1] + step * (body[0] + body[1])) * grain
    end = turn + body[5] / (body[0] + body[1])
    edges = breaks(-tail, turn, end, markers, half_band)
    previous = np.empty((FACETS + 1, 5))
    current = np.empty((FACETS + 1, 5))
    for interval in range(edges.size - 1):
        first, last = edges[interval], edges[interval + 1]
        if last - first <= 0.0:
            continue
        middle = 0.5 * (first + last)
        value = 1
        for n in range(markers.size):
            if abs(middle - markers[n]) < half_band[n]:
                value = 2 + n
        count = math.ceil((last - first) / step)
        seen = section(lens, body, grid, height, light, first, size, previous)
        for k in range(1, count + 1):
            theta = first + (last - first) * k / count
            visible = section(lens, body, grid, height, light, theta, size, current)
            if visible and seen:
                for m in range(FACETS):
                    fill_triangle(
                        previous[m], previous[m + 1], current[m],
                        value, inverse_depth, label, shade, gloss, touched, samples,
                    )  # fmt: skip
                    fill_triangle(
                        current[m], previous[m + 1], current[m + 1],
                        value, inverse_depth, label, shade, gloss, touched, samples,
                    )  # fmt: skip
            seen = visible
            previous, current = current, previous
