"""The cable as strips of facets between cross-sections, no more of it than the window shows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import compiled
from winding_rig_node.camera.cable_path import path_crosses, path_height
from winding_rig_node.camera.cable_section import (
    FACETS,
    Bounds,
    Cable,
    Lighting,
    Rim,
    View,
    corner,
    empty_rim,
    section,
    span_slope,
)
from winding_rig_node.camera.optics import Lens
from winding_rig_node.camera.raster import Samples, fill_triangle, touch
from winding_rig_node.camera.sight import RayRange, Sight, sight_of

FloatArray = NDArray[np.float64]

TURN = 2.0 * math.pi


@compiled
def draw_cable(
    lens: Lens, rays: RayRange, cable: Cable, light: Lighting, samples: Samples
) -> None:  # pragma: no cover
    """Draw cable (label 1) and marker bands (label 2 + n) into samples that hold the cylinder."""
    rho = cable.cylinder_radius + cable.cable_radius
    rows, columns = samples.inverse_depth.shape
    near = abs(lens.x) - cable.cylinder_radius - 2.0 * cable.cable_radius
    room = cable.cable_radius + cable.step * rho
    bounds = Bounds(float(columns), float(rows), room * lens.focal / near)
    landing_z, _ = path_height(cable.path, cable.turned)
    view = View(lens, cable, light, bounds, landing_z)
    sight = sight_of(lens, rays, rho, 1.1 * room)
    half_bands = _half_bands(view)
    edges = _breaks(cable, half_bands)
    one, other = empty_rim(), empty_rim()
    for interval in range(edges.size - 1):
        first, last = edges[interval], edges[interval + 1]
        if last - first <= 0.0:
            continue
        value = 1
        for n in range(cable.markers.size):
            if abs(0.5 * (first + last) - cable.markers[n]) < half_bands[n]:
                value = 2 + n
        free = first >= cable.turned
        lowest, highest = 0, 0
        if not free:
            lowest = math.ceil((cable.turned - last - sight.last_azimuth) / TURN)
            highest = math.floor((cable.turned - first - sight.first_azimuth) / TURN)
        count = math.ceil((last - first) / cable.step)
        scale = count / (last - first)
        for turn in range(lowest, highest + 1):
            start, end = _shown(view, sight, free, turn)
            start, end = max(start, first), min(end, last)
            if start <= end and _crosses(view, sight, free, start, end):
                from_k = max(math.floor((start - first) * scale), 0)
                to_k = min(math.ceil((end - first) * scale), count)
                seen = False
                for k in range(from_k, to_k + 1):
                    theta = first + (last - first) * k / count
                    visible = section(view, theta, other)
                    if visible and seen:
                        _draw_strip(one, other, value, samples)
                    seen = visible
                    one, other = other, one


@compiled
def _shown(
    view: View, sight: Sight, free: bool, turn: int
) -> tuple[float, float]:  # pragma: no cover
    """Return between which wound angles [rad] a turn, or the free span, stands in the window."""
    turned = view.cable.turned
    if free:
        rho = view.cable.cylinder_radius + view.cable.cable_radius
        return turned - sight.y_high / rho, turned - sight.y_low / rho
    front = turned - TURN * turn
    return front - sight.last_azimuth, front - sight.first_azimuth


@compiled
def _crosses(
    view: View, sight: Sight, free: bool, start: float, end: float
) -> bool:  # pragma: no cover
    """Return whether cable between two wound angles [rad] may reach the window's heights."""
    cable = view.cable
    if not free:
        return path_crosses(cable.path, start, end, sight.z_low, sight.z_high)
    slope = span_slope(view) * (cable.cylinder_radius + cable.cable_radius)
    one = view.landing_z + slope * (start - cable.turned)
    other = view.landing_z + slope * (end - cable.turned)
    return min(one, other) <= sight.z_high and max(one, other) >= sight.z_low


@compiled
def _half_bands(view: View) -> FloatArray:  # pragma: no cover
    """Return half of each band as wound angle [rad]; its length is measured along the cable."""
    cable = view.cable
    rho = cable.cylinder_radius + cable.cable_radius
    half = np.zeros(cable.markers.size)
    for n in range(cable.markers.size):
        theta = cable.markers[n]
        if math.isfinite(theta):
            if theta > cable.turned:
                slope = rho * span_slope(view)
            else:
                _, slope = path_height(cable.path, theta)
            half[n] = 0.5 * cable.band_width / math.hypot(rho, slope)
    return half


@compiled
def _breaks(cable: Cable, half_bands: FloatArray) -> FloatArray:  # pragma: no cover
    """Return the sorted wound angles [rad] where the cable changes: ends, landing, band edges."""
    start = -cable.tail
    end = cable.turned + cable.free_length / (cable.cylinder_radius + cable.cable_radius)
    edges = np.empty(3 + 2 * cable.markers.size)
    edges[0], edges[1], edges[2] = start, min(max(cable.turned, start), end), end
    for n in range(cable.markers.size):
        centre, half = cable.markers[n], half_bands[n]
        if not math.isfinite(centre):
            centre, half = start, 0.0
        edges[3 + 2 * n] = min(max(centre - half, start), end)
        edges[4 + 2 * n] = min(max(centre + half, start), end)
    # A sort of one's own: numpy's would cost a second to compile.
    for k in range(1, edges.size):
        moved, place = edges[k], k
        while place > 0 and edges[place - 1] > moved:
            edges[place] = edges[place - 1]
            place -= 1
        edges[place] = moved
    return edges


@compiled
def _draw_strip(one: Rim, other: Rim, value: int, samples: Samples) -> None:  # pragma: no cover
    """Draw the facets between two cross-sections."""
    left, right, top, bottom = math.inf, -math.inf, math.inf, -math.inf
    for k in range(FACETS + 1):
        left = min(left, one.column[k], other.column[k])
        right = max(right, one.column[k], other.column[k])
        top = min(top, one.row[k], other.row[k])
        bottom = max(bottom, one.row[k], other.row[k])
    if not touch(samples, left, right, top, bottom):
        return
    for m in range(FACETS):
        a, b = corner(one, m), corner(one, m + 1)
        c, d = corner(other, m), corner(other, m + 1)
        fill_triangle(a, b, c, value, samples)
        fill_triangle(c, b, d, value, samples)
