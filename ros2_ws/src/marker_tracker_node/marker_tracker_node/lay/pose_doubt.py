"""How far the lay may be off because the camera stands elsewhere than it is thought to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.lay.rows import COLUMN_STEP, RowTables, meetings
from marker_tracker_node.tracking.pose_correction import PoseBelief

FloatArray = NDArray[np.float64]

# Steps of the differences [rad], [m]: small beside a pose, large beside rounding.
STEP = 1.0e-4
# How well P0 tells the camera's turn [rad]: smaller ones are not applied (`camera_zero`).
TURN_LEFT = 1.2e-4


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
            camera: What CameraInfo says.
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
