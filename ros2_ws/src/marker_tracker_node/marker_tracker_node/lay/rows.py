"""Where the rows of a picture meet the lay: the cylinder's centre-line surface and the free span.

A turn of radius r whose centre stands at z hides what lies between z - w and z + w of the surface
of radius R + r, seen from the camera, with w = r / cos(beta): the rays that touch it pass at the
distance r from its centre, and beta is their angle from the plane across the axis. So the surface
through the centre lines is where edges are measured.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraPose, CameraView, PinholeCamera, plane_of_pixel
from marker_tracker_node.tracking.refinement import PoseBelief
from winding_core.compiling import compiled

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

# Columns between which places are interpolated; lenses bend less than 1e-4 px within them.
COLUMN_STEP = 8

HALF_WANTED = 12.0
STEP = 1.0e-4  # Steps of the differences [rad], [m]: small beside a pose, large beside rounding
# How well P0 tells the camera's turn [rad]: smaller ones are not applied (`run_start`).
TURN_LEFT = 1.2e-4


class RowTables(NamedTuple):
    """What some rows of the picture look at; arrays of shape (rows, groups) but for `row`.

    So many columns are taken together that half a turn is about `HALF_WANTED` groups wide: more say
    no more, and cost time.
    """

    row: IndexArray  # Of the picture, shape (rows,)
    group: int  # Columns in each group; what is left over at the right is not looked at
    # Azimuth on the cylinder [rad]; on the free span, the way before the contact [m].
    place: FloatArray
    z: FloatArray  # [m]
    half: FloatArray  # Half the width of a level turn [groups]
    steep: FloatArray  # Tangent of beta, positive where rays come from lower z
    reach: FloatArray  # Distance of the camera from the surface, along its normal [m]


@compiled
def meetings(
    view: CameraView, rho: float, free: bool, columns: FloatArray, rows: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return place, z [m], steepness and reach [m] of rays, shape (rows, columns, 4).

    They are nan where a ray misses the lay.
    """
    met = np.full((rows.size, columns.size, 4), math.nan)
    for v in range(rows.size):
        for u in range(columns.size):
            a, b = plane_of_pixel(view, columns[u], rows[v])
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
                    continue
                depth = (-half - math.sqrt(room)) / square
                place = math.atan2(view.y + depth * dy, view.x + depth * dx)
                reach = view.x * math.cos(place) + view.y * math.sin(place) - rho
            z = view.z + depth * dz
            met[v, u, 0] = place
            met[v, u, 1] = z
            met[v, u, 2] = (z - view.z) / reach
            met[v, u, 3] = reach
    return met


def row_tables(
    view: CameraView, columns: int, *, rho: float, cable_radius: float, rows: list[int], free: bool
) -> RowTables:
    """Return what rows of the picture look at.

    Args:
        view: The camera.
        columns: Of the picture.
        rho: R + r [m].
        cable_radius: r [m].
        rows: Of the picture.
        free: Whether the rows show the free span.
    """
    coarse = np.arange(-COLUMN_STEP, columns + COLUMN_STEP, COLUMN_STEP, dtype=float)
    met = meetings(view, rho, free, coarse, np.array(rows, dtype=float))
    per_column = np.gradient(met[:, :, 1], coarse, axis=1)
    half = cable_radius * np.sqrt(1.0 + met[:, :, 2] ** 2) / np.abs(per_column)
    group = max(1, round(float(np.median(half)) / HALF_WANTED)) if rows else 1
    at = group * (np.arange(columns // group) + 0.5) - 0.5

    def finer(part: FloatArray) -> FloatArray:
        lines = [np.interp(at, coarse, line) for line in part]
        return np.array(lines).reshape(len(rows), at.size)

    place, z, steep, reach = (finer(met[:, :, k]) for k in range(4))
    return RowTables(
        np.array(rows, dtype=np.int64), group, place, z, finer(half) / group, steep, reach
    )


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
) -> tuple[RowTables, RowTables]:
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
    middle = np.array([0.5 * (columns - 1)])
    inner = np.arange(1.0, rows - 1.0)
    made = []
    for free, low, high, count in (
        (False, 0.0, widest, azimuths),
        (True, 0.5 * cable_radius, longest, ways),
    ):
        places = meetings(view, rho, free, middle, inner)[:, 0, 0]
        found = sorted(
            (float(place), int(row))
            for place, row in zip(places, inner, strict=True)
            if low < place <= high
        )
        picked = sorted({round(k) for k in np.linspace(0, len(found) - 1, min(count, len(found)))})
        made.append(
            row_tables(
                view,
                columns,
                rho=rho,
                cable_radius=cable_radius,
                rows=[found[k][1] for k in picked],
                free=free,
            )
        )
    return made[0], made[1]


class PoseDoubt:
    """Standard deviation of z that comes from the camera's pose, along the cylinder.

    A turn that is wound theta behind P0 is sought at the azimuth where P0's angle puts it, so an
    error of azimuth counts too, with the slope of the cable.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        pose: CameraPose,
        belief: PoseBelief,
        *,
        rho: float,
        rows: RowTables,
    ) -> None:
        """Take the differences that the six numbers of a pose make.

        Args:
            camera: Content of CameraInfo.
            pose: As it is thought to be.
            belief: How well that is known.
            rho: R + r [m].
            rows: That are measured.
        """
        columns = np.arange(0.0, camera.shape[1], COLUMN_STEP)

        def met(change: FloatArray) -> FloatArray:
            moved = replace(
                pose,
                tilt=tuple(np.add(pose.tilt, change[:3]).tolist()),
                position=tuple(np.add(pose.position, change[3:]).tolist()),
            )
            return meetings(camera.view(moved), rho, False, columns, rows.row.astype(float))

        steps = STEP * np.eye(6)
        # Azimuth and z of each pose number, row and column.
        change = np.array([(met(step) - met(-step))[..., :2] / (2.0 * STEP) for step in steps])
        here = met(np.zeros(6))
        self._rho = rho
        self._reach = float(here[0, columns.size // 2, 3])
        self._z = here[..., 1].mean(axis=0)
        self._azimuth, self._height = change.mean(axis=1).transpose(2, 0, 1)
        self._covariance = np.diag(belief.sigmas**2)
        self._anchor = np.array(
            [
                [np.interp(0.0, here[0, :, 1], scale * part[0, :, k]) for part in change]
                for k, scale in ((0, rho), (1, 1.0))
            ]
        )

    def sigma(self, z: FloatArray, slope: float, *, anchored: bool) -> FloatArray:
        """Return one standard deviation of z [m] where cable lies.

        Args:
            z: Where it was measured [m], shape (n,).
            slope: dz/dtheta of the cable [m/rad].
            anchored: Whether the camera was turned until P0 stood where it must.
        """
        covariance = self._covariance
        if anchored:
            seen = self._anchor
            noise = (TURN_LEFT * self._reach) ** 2 * np.eye(2)
            gain = covariance @ seen.T @ np.linalg.inv(seen @ covariance @ seen.T + noise)
            covariance = covariance - gain @ seen @ covariance
        change = self._height + slope * self._azimuth
        variance = np.einsum("ik,ij,jk->k", change, covariance, change)
        here = np.asarray(np.interp(z, self._z, variance), dtype=float)
        return np.asarray(np.sqrt(np.maximum(here, 0.0)), dtype=float)
