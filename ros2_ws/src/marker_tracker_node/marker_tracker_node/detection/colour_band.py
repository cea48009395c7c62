"""The detector of painted marks: a ring or a patch of one colour, which names no marker.

A band is measured by the mean of its pixels. Where light hides a part its pixels are unknown,
neither marker nor background: the outline of the band is moved until it explains those that are
known. What is unknown then counts as the outline has it, so that the centre is not drawn towards
the part that is seen.
"""

import math
from typing import NamedTuple

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.camera.pinhole import (
    CameraView,
    pixel_of_plane,
    plane_of_pixel,
    plane_of_point,
)
from marker_tracker_node.detection.band import (
    Band,
    Body,
    own_edges,
    seen_from,
    solve_seen_band,
    surface_point,
    visible_arc,
)
from marker_tracker_node.detection.gate import (
    MEASURED,
    NO_IDENTITY,
    NOTHING,
    PARTLY,
    Detection,
    Gates,
    Picture,
    gate_columns,
    gate_moments,
    gate_place,
    gate_rows,
    table_index,
)
from winding_core.compiling import called, compiled

# Of an outline; the rows of its array.
NODES = 9
ACROSS, FRONT, BACK = range(3)
# Fewer unknown pixels hide nothing.
LEAST_UNKNOWN = 4
STEPS = 8
STILL = 0.01  # Steps end when the outline moves less [px]
MOST_GAIN = 4.0  # A step is at most so many times what it would be with every edge in sight
# What is summed over a gate: marker pixels with the unknown ones as covered, the outline's cover,
# its part that is unknown, and the pixels on its edges.
(
    _COUNT, _WEIGHT, _WEIGHT_ALONG, _WEIGHT_ACROSS, _COVER, _COVER_ALONG, _COVER_ACROSS,
    _COVER_UNKNOWN, _END, _END_UNKNOWN, _SIDE, _SIDE_UNKNOWN, _SUMS,
) = range(13)  # fmt: skip
# Share of the expected area within which a gathering of pixels may be a new band, and within
# which a known band is whole: one that is covered in part would be measured beside its middle.
NEW_AREA = (0.7, 1.4)
WHOLE_AREA = (0.87, 1.2)
# By so much a mask makes bands smaller, as their edges are mixed pixels, or larger where they are
# blurred; what is beyond is another band width than configured.
MASK_AREA = 0.05
GLARE_BELOW = 0.97  # Below this share of its area it is asked whether light hides a part
# So much of a band and of the edges that tell its place must be known.
LEAST_VISIBLE, LEAST_EDGES = 0.25, 0.25


class Fit(NamedTuple):
    """A band that is seen in part."""

    # Pixels of the gate that may be marker or not; of no use below LEAST_UNKNOWN, and then the only
    # number.
    unknown: int
    marked: int  # Marker pixels
    expected: float  # Known pixels that lie within the outline
    visible: float  # Share of the outline that is known
    column: float  # Of the centre of the whole band [px]
    row: float  # The same
    ends: float  # Share of the edges across the cable that is known: they tell the azimuth
    sides: float  # Share of the edges along the cable that is known: they tell z


@compiled
def fit_outline(
    picture: Picture, gates: Gates, n: int, view: CameraView, body: Body, band: Band, area: float
) -> Fit:  # pragma: no cover
    """Return where a band lies of which a part may be unknown, expected in gate n.

    Area is that measured over the expected one where the whole band is seen.
    """
    unknown = _count_unknown(picture, gates, n)
    if unknown < LEAST_UNKNOWN:
        return Fit(unknown, 0, 0.0, 0.0, math.nan, math.nan, 0.0, 0.0)
    outline = np.empty((3, NODES))
    _draw(view, body, band, gates, n, outline)
    length = outline[FRONT, NODES // 2] - outline[BACK, NODES // 2]
    width = outline[ACROSS, NODES - 1] - outline[ACROSS, 0]
    # Pixels on the edge count as marker or not: the area tells where that changes.
    grown = 0.5 * (area - 1.0) * length * width / max(length + width, 1.0)
    tu, tv = gates.along_u[n], gates.along_v[n]
    ahead, aside = 0.0, 0.0
    sums = np.empty(_SUMS)
    for _ in range(STEPS):
        _sum(picture, gates, n, outline, (ahead, aside, grown), sums)
        if sums[_WEIGHT] <= 0.0 or sums[_COVER] <= 0.0:
            break
        ends = 1.0 - sums[_END_UNKNOWN] / max(sums[_END], 1.0)
        sides = 1.0 - sums[_SIDE_UNKNOWN] / max(sums[_SIDE], 1.0)
        off = sums[_WEIGHT_ALONG] / sums[_WEIGHT] - sums[_COVER_ALONG] / sums[_COVER]
        beside = sums[_WEIGHT_ACROSS] / sums[_WEIGHT] - sums[_COVER_ACROSS] / sums[_COVER]
        ahead += off / max(ends, 1.0 / MOST_GAIN)
        aside += beside / max(sides, 1.0 / MOST_GAIN)
        if abs(off) + abs(beside) < STILL:
            break
    if sums[_WEIGHT] <= 0.0 or sums[_COVER] <= 0.0:
        return Fit(unknown, int(sums[_COUNT]), 0.0, 0.0, math.nan, math.nan, 0.0, 0.0)
    along = sums[_WEIGHT_ALONG] / sums[_WEIGHT]
    across = sums[_WEIGHT_ACROSS] / sums[_WEIGHT]
    return Fit(
        unknown,
        int(sums[_COUNT]),
        sums[_COVER] - sums[_COVER_UNKNOWN],
        1.0 - sums[_COVER_UNKNOWN] / sums[_COVER],
        gates.column[n] + along * tu - across * tv,
        gates.row[n] + along * tv + across * tu,
        ends,
        sides,
    )


@called
def _count_unknown(picture: Picture, gates: Gates, n: int) -> int:  # pragma: no cover
    """Return how many pixels of gate n may be marker or not."""
    unknown = 0
    top, bottom = gate_rows(picture, gates, n)
    for v in range(top, bottom + 1):
        first, last = gate_columns(picture.pixels, gates, n, v - gates.row[n])
        line = picture.pixels[v]
        for u in range(first, last + 1):
            index = table_index(line[u, 0], line[u, 1], line[u, 2])
            unknown += picture.tables[index] & (1 - picture.table[index])
    return unknown


@called
def _draw(
    view: CameraView, body: Body, band: Band, gates: Gates, n: int, outline: FloatArray
) -> None:  # pragma: no cover
    """Write the edges of the visible side of a band, in the coordinates of its gate [px]."""
    rho, r, half = body.rho + band.lift, body.cable_radius, body.half_band
    norm = math.hypot(rho, band.slope)
    first, last = visible_arc(body, band, *seen_from(view, rho, band))
    way = half / norm
    for k in range(NODES):
        psi = first + (last - first) * k / (NODES - 1)
        outline[ACROSS, k] = 0.0
        for edge, ahead in ((FRONT, way), (BACK, -way)):
            place = band.z + band.slope * ahead
            x, y, z = surface_point(rho, r, band.azimuth - ahead, place, band.slope, psi)
            a, b, _depth = plane_of_point(view, x, y, z)
            u, v = pixel_of_plane(view, a, b)
            outline[edge, k], across = gate_place(gates, n, u, v)
            outline[ACROSS, k] += 0.5 * across


@called
def _sum(
    picture: Picture,
    gates: Gates,
    n: int,
    outline: FloatArray,
    moved: tuple[float, float, float],
    sums: FloatArray,
) -> None:  # pragma: no cover
    """Sum over gate n what tells how far an outline lies beside the marker pixels.

    It is moved by so much along and across the cable, and made so much larger [px].
    """
    ahead, aside, grown = moved
    left, right = outline[ACROSS, 0] - grown, outline[ACROSS, NODES - 1] + grown
    sums[:] = 0.0
    top, bottom = gate_rows(picture, gates, n)
    for v in range(top, bottom + 1):
        first, last = gate_columns(picture.pixels, gates, n, v - gates.row[n])
        line = picture.pixels[v]
        for u in range(first, last + 1):
            along, across = gate_place(gates, n, u, v)
            away = across - aside
            k = 1
            while k < NODES - 1 and outline[ACROSS, k] < away:
                k += 1
            low, high = outline[ACROSS, k - 1], outline[ACROSS, k]
            part = min(max((away - low) / max(high - low, 1.0e-6), 0.0), 1.0)
            front = outline[FRONT, k - 1] + part * (outline[FRONT, k] - outline[FRONT, k - 1])
            back = outline[BACK, k - 1] + part * (outline[BACK, k] - outline[BACK, k - 1])
            end = min(front + ahead - along, along - ahead - back) + grown
            side = min(away - left, right - away)
            cover = min(max(min(end, side) + 0.5, 0.0), 1.0)
            index = table_index(line[u, 0], line[u, 1], line[u, 2])
            hit = picture.table[index]
            hidden = picture.tables[index] & (1 - hit)
            weight = hit + hidden * cover
            sums[_COUNT] += hit
            sums[_WEIGHT] += weight
            sums[_WEIGHT_ALONG] += weight * along
            sums[_WEIGHT_ACROSS] += weight * across
            sums[_COVER] += cover
            sums[_COVER_ALONG] += cover * along
            sums[_COVER_ACROSS] += cover * across
            sums[_COVER_UNKNOWN] += hidden * cover
            if 0.0 < cover < 1.0:
                if end < side:
                    sums[_END] += 1.0
                    sums[_END_UNKNOWN] += hidden
                else:
                    sums[_SIDE] += 1.0
                    sums[_SIDE_UNKNOWN] += hidden


@compiled
def measure(
    picture: Picture,
    view: CameraView,
    body: Body,
    gates: Gates,
    n: int,
    band: Band,
    pixels: float,
    area: float,
    whole: float,
    limits: tuple[float, float],
) -> Detection:  # pragma: no cover
    """Measure what is painted on the cable as its `Body` describes: a ring, or a patch of it.

    Args:
        picture: Frame, and the colour that is sought.
        view: The camera.
        body: What the band is painted on.
        gates: Where to look.
        n: Which of them.
        band: As expected, of which the gate was predicted.
        pixels: That it should fill [px].
        area: Its usual share of them (dimensionless).
        whole: The same of bands that are seen whole (dimensionless).
        limits: Least and most accepted share of the expected area.
    """
    least, most = limits
    count, column, row = gate_moments(picture, gates, n)
    share = count / max(pixels * area, 1.0)
    outcome, azimuth_factor, z_factor = MEASURED, 1.0, 1.0
    if share < GLARE_BELOW and count >= 4:
        fit = fit_outline(picture, gates, n, view, body, band, area)
        if fit.unknown >= LEAST_UNKNOWN:
            outcome = PARTLY
            share = fit.marked / max(fit.expected, 1.0)
            column, row = fit.column, fit.row
            # The less there is of it, the more the pixels on its edges count.
            room = 1.0 / math.sqrt(max(fit.visible, LEAST_VISIBLE))
            least, most = 1.0 - (1.0 - least) * room, 1.0 + (most - 1.0) * room
            if min(fit.ends, fit.sides) < LEAST_EDGES or fit.visible < LEAST_VISIBLE:
                share = 0.0
            azimuth_factor = 1.0 / math.sqrt(max(fit.ends, LEAST_EDGES))
            z_factor = 1.0 / math.sqrt(max(fit.sides, LEAST_EDGES))
    if count < 4 or share < least or share > most:
        return NOTHING
    below, above = own_edges(view, body, band)
    edges = below + above
    if edges == 1:
        # What the mask has wrong at one edge is not made up for at the other one.
        length = 2.0 * gates.half_band[n]
        grown = min(max(whole - 1.0, -MASK_AREA), MASK_AREA) / (
            2.0 * length / pixels + 2.0 / length
        )
        aside = 0.5 * grown * (below - above)
        column -= aside * gates.along_v[n]
        row += aside * gates.along_u[n]
    a, b = plane_of_pixel(view, column, row)
    seen = gates.seen_a[n], gates.seen_b[n]
    azimuth, z = solve_seen_band(view, body, (a, b), band, seen)
    if not (math.isfinite(azimuth) and math.isfinite(z)):
        return NOTHING
    if edges < 2:
        # Where a band is cut off stays as the gate has it: of its own way half is seen, or nothing.
        # One edge errs as much as the mean of two does times the root of two.
        z_factor *= math.sqrt(2.0) if edges > 0 else math.inf
        z = band.z + (2.0 * (z - band.z) if edges > 0 else 0.0)
    return Detection(outcome, azimuth, z, share, azimuth_factor, z_factor, NO_IDENTITY)
