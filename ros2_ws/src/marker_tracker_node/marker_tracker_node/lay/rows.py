"""Where the rows of a picture meet the lay: the cylinder's centre-line surface and the free span.

A turn of radius r whose centre stands at z hides what lies between z - w and z + w of the surface
of radius R + r, seen from the camera, with w = r / cos(beta): the rays that touch it pass at the
distance r from its centre, and beta is their angle from the plane across the axis. So the surface
through the centre lines is where edges are measured.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraView, plane_of_pixel
from winding_core.compiling import compiled

FloatArray = NDArray[np.float64]

# Columns between which places are interpolated; lenses bend less than 1e-4 px within them.
COLUMN_STEP = 8

HALF_WANTED = 12.0


class RowTable(NamedTuple):
    """What a row of the picture looks at, arrays with a place for each group of columns.

    So many columns are taken together that half a turn is about `HALF_WANTED` groups wide: more say
    no more, and cost time.

    Attributes:
        row: Of the picture.
        group: Columns in each group; what is left over at the right is not looked at.
        free: Whether the row looks at the free span.
        place: Azimuth on the cylinder [rad]; on the free span, the way before the contact [m].
        z: [m]
        half: Half the width of a level turn [groups].
        steep: Tangent of beta, positive where rays come from lower z.
        reach: Distance of the camera from the surface, along its normal [m].
    """

    row: int
    group: int
    free: bool
    place: FloatArray
    z: FloatArray
    half: FloatArray
    steep: FloatArray
    reach: FloatArray


@compiled
def _meeting(
    view: CameraView, rho: float, free: bool, column: float, row: float
) -> tuple[float, float, float, float]:  # pragma: no cover
    """Return place, z [m], steepness and reach [m] where a pixel's ray meets the lay."""
    a, b = plane_of_pixel(view, column, row)
    dx = view.right_x * a + view.down_x * b + view.forward_x
    dy = view.right_y * a + view.down_y * b + view.forward_y
    dz = view.right_z * a + view.down_z * b + view.forward_z
    if free:
        depth = (rho - view.x) / dx
        reach = view.x - rho
        place = -(view.y + depth * dy)
    else:
        square = dx * dx + dy * dy
        half = view.x * dx + view.y * dy
        room = half * half - square * (view.x * view.x + view.y * view.y - rho * rho)
        if room < 0.0:
            return math.nan, math.nan, math.nan, math.nan
        depth = (-half - math.sqrt(room)) / square
        place = math.atan2(view.y + depth * dy, view.x + depth * dx)
        reach = view.x * math.cos(place) + view.y * math.sin(place) - rho
    z = view.z + depth * dz
    return place, z, (z - view.z) / reach, reach


def row_table(
    view: CameraView, columns: int, *, rho: float, cable_radius: float, row: int, free: bool
) -> RowTable:
    """Return what a row of the picture looks at.

    Args:
        view: The camera.
        columns: Of the picture.
        rho: R + r [m].
        cable_radius: r [m].
        row: Of the picture.
        free: Whether the row shows the free span.
    """
    coarse = np.arange(-COLUMN_STEP, columns + COLUMN_STEP, COLUMN_STEP, dtype=float)
    met = np.array([_meeting(view, rho, free, column, float(row)) for column in coarse])
    per_column = np.gradient(met[:, 1], coarse)
    half = cable_radius * np.sqrt(1.0 + met[:, 2] ** 2) / np.abs(per_column)
    group = max(1, round(float(np.median(half)) / HALF_WANTED))
    at = group * (np.arange(columns // group) + 0.5) - 0.5
    place, z, steep, reach = (np.interp(at, coarse, part) for part in met.T)
    half = np.interp(at, coarse, half) / group
    return RowTable(row, group, free, place, z, half, steep, reach)


def choose_rows(
    view: CameraView,
    shape: tuple[int, int],
    *,
    rho: float,
    cable_radius: float,
    azimuths: int,
    widest: float,
    ways: int,
    longest: float,
) -> tuple[list[RowTable], list[RowTable]]:
    """Return rows over the wound cable, by rising azimuth, and over the free span, by rising way.

    Args:
        view: The camera.
        shape: Rows and columns of the picture.
        rho: R + r [m].
        cable_radius: r [m].
        azimuths: Most rows on the cylinder.
        widest: Largest azimuth [rad].
        ways: Most rows on the free span.
        longest: Largest way before the contact line [m].
    """
    rows, columns = shape
    middle = 0.5 * (columns - 1)
    inner = range(1, rows - 1)
    wound, free = [], []
    for row in inner:
        azimuth = _meeting(view, rho, False, middle, float(row))[0]
        way = _meeting(view, rho, True, middle, float(row))[0]
        if 0.0 < azimuth <= widest:
            wound.append((azimuth, row))
        if 0.5 * cable_radius < way <= longest:
            free.append((way, row))
    made = []
    for found, count, is_free in ((wound, azimuths, False), (free, ways, True)):
        found.sort()
        picked = sorted({round(k) for k in np.linspace(0, len(found) - 1, min(count, len(found)))})
        made.append(
            [
                row_table(
                    view, columns, rho=rho, cable_radius=cable_radius, row=found[k][1], free=is_free
                )
                for k in picked
            ]
        )
    return made[0], made[1]
