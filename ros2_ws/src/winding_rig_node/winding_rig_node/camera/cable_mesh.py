"""The cable as facets between cross-sections, no more of it than the window shows."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called, compiled
from winding_rig_node.camera.cable_path import PathTable, path_crosses
from winding_rig_node.camera.cable_section import (
    FACETS,
    Bounds,
    Cable,
    Lighting,
    View,
    centre_line,
    section,
    span_rise,
)
from winding_rig_node.camera.optics import Lens, RayRange, Sight, sight_of
from winding_rig_node.camera.raster import (
    Samples,
    begin,
    direction,
    draw_ribbon,
    draw_triangles,
    extend,
)

FloatArray = NDArray[np.float64]

TURN = 2.0 * math.pi


class Stretch(NamedTuple):
    """Cable of one label: wound angles of its ends [rad], steps between its sections, the label."""

    first: float
    last: float
    steps: int
    value: int


class Room(NamedTuple):
    """Room for sections and for what they make of rows; see `ribbon`."""

    rims: FloatArray
    crossings: FloatArray


@compiled
def draw_cable(
    lens: Lens,
    rays: RayRange,
    light: Lighting,
    gloss: FloatArray,
    cable: Cable,
    path: PathTable,
    markers: FloatArray,
    samples: Samples,
) -> None:  # pragma: no cover
    """Draw cable (label 1) and marker bands (label 2 + n) into samples that hold the cylinder.

    Args:
        lens: The camera.
        rays: Through its window.
        light: On the cable.
        gloss: See `section`.
        cable: To be drawn.
        path: Where it lies on the cylinder.
        markers: Wound angles [rad], nan for none, shape (n,).
        samples: To be written.
    """
    rho = cable.cylinder_radius + cable.cable_radius
    rows, columns = samples.seen.shape[:2]
    near = abs(lens.x) - cable.cylinder_radius - 2.0 * cable.cable_radius
    room = cable.cable_radius + cable.step * rho
    bounds = Bounds(float(columns), float(rows), room * lens.focal / near)
    view = View(lens, cable, light, bounds)
    # Chords and slanted rays reach a little farther than the section itself.
    raised = path.lift.max() if path.lift.size else 0.0
    sight = sight_of(lens, rays, rho, 1.1 * room + raised)
    half_bands = _half_bands(cable, path, markers)
    edges = _breaks(cable, markers, half_bands)
    room_for = Room(np.empty((3, FACETS + 1, 5)), np.empty((rows, FACETS + 1, 4)))
    for interval in range(edges.size - 1):
        first, last = edges[interval], edges[interval + 1]
        if last - first <= 0.0:
            continue
        value = 1
        for n in range(markers.size):
            if abs(0.5 * (first + last) - markers[n]) < half_bands[n]:
                value = 2 + n
        free = first >= cable.turned
        lowest, highest = 0, 0
        if not free:
            lowest = math.ceil((cable.turned - last - sight.last_azimuth) / TURN)
            highest = math.floor((cable.turned - first - sight.first_azimuth) / TURN)
        stretch = Stretch(first, last, math.ceil((last - first) / cable.step), value)
        for turn in range(lowest, highest + 1):
            start, end = _shown(cable, sight, free, turn)
            start, end = max(start, first), min(end, last)
            if start <= end and _crosses(cable, path, sight, start, end):
                _draw_stretch(view, gloss, path, stretch, start, end, room_for, samples)


@called
def _shown(
    cable: Cable, sight: Sight, free: bool, turn: int
) -> tuple[float, float]:  # pragma: no cover
    """Return between which wound angles [rad] a turn, or the free span, stands in the window."""
    if free:
        rho = cable.cylinder_radius + cable.cable_radius
        return cable.turned - sight.y_high / rho, cable.turned - sight.y_low / rho
    front = cable.turned - TURN * turn
    return front - sight.last_azimuth, front - sight.first_azimuth


@called
def _crosses(
    cable: Cable, path: PathTable, sight: Sight, start: float, end: float
) -> bool:  # pragma: no cover
    """Return whether cable between two wound angles [rad] may reach the window's heights."""
    if end <= cable.turned:
        return path_crosses(path, start, end, sight.z_low, sight.z_high)
    slope = span_rise(cable) * (cable.cylinder_radius + cable.cable_radius)
    one = cable.landing_z + slope * (start - cable.turned)
    other = cable.landing_z + slope * (end - cable.turned)
    return min(one, other) <= sight.z_high and max(one, other) >= sight.z_low


@called
def _draw_stretch(
    view: View,
    gloss: FloatArray,
    path: PathTable,
    stretch: Stretch,
    start: float,
    end: float,
    room: Room,
    samples: Samples,
) -> None:  # pragma: no cover
    """Draw the part of a stretch between two wound angles [rad]."""
    # Plain arrays: each array taken out of a tuple, or each part of one, costs a locked count.
    grid, heights, lifts, blocks = path.theta, path.z, path.lift, path.first
    rims, crossings = room.rims, room.crossings
    width = stretch.last - stretch.first
    from_k = max(math.floor((start - stretch.first) * stretch.steps / width), 0)
    to_k = min(math.ceil((end - stretch.first) * stretch.steps / width), stretch.steps)
    way, seen = 0, False
    for k in range(from_k, to_k + 1):
        one, other = 1 + k % 2, 2 - k % 2
        theta = stretch.first + width * k / stretch.steps
        place = centre_line(view.cable, grid, heights, lifts, blocks, theta)
        visible = section(view, gloss, place, rims, other)
        both, seen = visible and seen, visible
        ahead = direction(rims, one, other) if both else 0
        if way not in (0, ahead):
            draw_ribbon(crossings, rims, one, stretch.value, samples)
        if ahead not in (0, way):
            begin(rims, one)
        if ahead != 0:
            extend(crossings, rims, one, other)
        elif both:
            draw_triangles(rims, one, other, stretch.value, samples)
        way = ahead
    if way != 0:
        draw_ribbon(crossings, rims, 2 - to_k % 2, stretch.value, samples)


@called
def _half_bands(
    cable: Cable, path: PathTable, markers: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return half of each band as wound angle [rad]; its length is measured along the cable."""
    rho = cable.cylinder_radius + cable.cable_radius
    half = np.zeros(markers.size)
    for n in range(markers.size):
        if math.isfinite(markers[n]):
            place = centre_line(cable, path.theta, path.z, path.lift, path.first, markers[n])
            half[n] = 0.5 * cable.band_width / (rho * math.hypot(1.0, place.rise))
    return half


@called
def _breaks(
    cable: Cable, markers: FloatArray, half_bands: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return the sorted wound angles [rad] where the cable changes: ends, landing, band edges."""
    start = -cable.tail
    end = cable.turned + cable.free_length / (cable.cylinder_radius + cable.cable_radius)
    edges = np.empty(3 + 2 * markers.size)
    edges[0], edges[1], edges[2] = start, min(max(cable.turned, start), end), end
    for n in range(markers.size):
        centre, half = markers[n], half_bands[n]
        if not math.isfinite(centre):
            centre, half = start, 0.0
        edges[3 + 2 * n] = min(max(centre - half, start), end)
        edges[4 + 2 * n] = min(max(centre + half, start), end)
    # Sorted by hand: numpy's sort takes two seconds to compile.
    for k in range(1, edges.size):
        moved, place = edges[k], k
        while place > 0 and edges[place - 1] > moved:
            edges[place] = edges[place - 1]
            place -= 1
        edges[place] = moved
    return edges
