"""Joint fit of the camera's pose and of every marker to all sightings of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraPose, CameraView, PinholeCamera
from marker_tracker_node.detection.band import Band, Body, band_centroid
from marker_tracker_node.tracking.config import TrackerConfig
from winding_core.compiling import compiled

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

# What is believed of the pose before the run: it keeps the fit from trading one for another
# where the sightings say nothing.
TILT_SIGMA = 0.02
POSITION_SIGMA = 2.0e-3
SHIFT_SIGMA = 0.02
ROBUST_PIXELS = 1.0
LEAST_SIGHTINGS = 20
POSE_SIZE = 6


@dataclass(frozen=True, kw_only=True)
class Sightings:
    """Every measured band of a run, one row each.

    Attributes:
        marker: Number n, shape (k,).
        angle: Cylinder angle of its frame [rad], shape (k,).
        azimuth: As seen with `pose` [rad], unwrapped, shape (k,).
        z: As seen with `pose` [m], shape (k,).
        slope: dz/dtheta of the cable there [m/rad], shape (k,).
        low: Cut by the neighbouring turn at -z, see `Band` [rad], shape (k,).
        high: The same at +z, shape (k,).
        pose: Of the camera with which azimuth and z were computed.
    """

    marker: IndexArray
    angle: FloatArray
    azimuth: FloatArray
    z: FloatArray
    slope: FloatArray
    low: FloatArray
    high: FloatArray
    pose: CameraPose


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """What the joint fit says.

    Attributes:
        pose: Of the camera.
        theta: Wound angle of each marker relative to P0 [rad], nan for one never seen.
        z: Axial position relative to P0 [m], nan likewise.
        sigma_theta: One standard deviation [rad].
        sigma_z: One standard deviation [m].
        residual: Root mean square distance between picture and model [px].
        sightings: How many went in.
    """

    pose: CameraPose
    theta: FloatArray
    z: FloatArray
    sigma_theta: FloatArray
    sigma_z: FloatArray
    residual: float
    sightings: int


def refine(config: TrackerConfig, camera: PinholeCamera, sightings: Sightings) -> Refinement:
    """Fit pose, encoder shift and all markers at once.

    P0 is the origin of wound angles and heights; its azimuth is the cylinder angle.

    Args:
        config: Machine and cable.
        camera: What CameraInfo says.
        sightings: Of a run, see `Tracker.sightings`.

    Raises:
        ValueError: There are too few sightings, or P0 was never seen.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415 - after a run, never within one

    if len(sightings.marker) < LEAST_SIGHTINGS:
        raise ValueError(
            f"a refinement needs at least {LEAST_SIGHTINGS} sightings, got {len(sightings.marker)}"
        )
    if not (sightings.marker == 0).any():
        raise ValueError("a refinement needs sightings of P0, there are none")
    body = config.body
    goal = _pictures(camera.view(sightings.pose), body, sightings.azimuth, sightings.z, sightings)
    count = config.marker_count + 1
    seen = np.array([n for n in range(1, count) if (sightings.marker == n).any()], dtype=np.int64)
    place = np.zeros(count, dtype=np.int64)
    place[seen] = np.arange(1, seen.size + 1)
    row = place[sightings.marker]
    focal = math.sqrt(camera.k[0, 0] * camera.k[1, 1]) / camera.binning
    start = np.zeros(POSE_SIZE + 1 + 2 * seen.size)
    for i, n in enumerate(seen):
        mine = sightings.marker == n
        start[POSE_SIZE + 1 + i] = np.median((sightings.angle - sightings.azimuth)[mine])
        start[POSE_SIZE + 1 + seen.size + i] = np.median(sightings.z[mine])

    def residuals(x: FloatArray) -> FloatArray:
        theta = np.concatenate([[0.0], x[POSE_SIZE + 1 : POSE_SIZE + 1 + seen.size]])
        z = np.concatenate([[0.0], x[POSE_SIZE + 1 + seen.size :]])
        view = camera.view(_moved(sightings.pose, x[:POSE_SIZE]))
        azimuth = sightings.angle + x[POSE_SIZE] - theta[row]
        off = (_pictures(view, body, azimuth, z[row], sightings) - goal) * focal
        prior = np.concatenate(
            [x[:3] / TILT_SIGMA, x[3:POSE_SIZE] / POSITION_SIGMA, [x[POSE_SIZE] / SHIFT_SIGMA]]
        )
        return np.concatenate([off.ravel(), prior])

    scale = np.concatenate([np.full(3, 1e-3), np.full(3, 1e-3), np.full(1 + seen.size, 1e-3),
                            np.full(seen.size, 1e-4)])  # fmt: skip
    fit = least_squares(residuals, start, x_scale=scale, loss="soft_l1", f_scale=ROBUST_PIXELS)
    off = residuals(fit.x)[: goal.size]
    variance = float((off**2).mean())
    spread = np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)) * variance)
    theta, z, sigma_theta, sigma_z = (np.full(count, math.nan) for _ in range(4))
    theta[0] = z[0] = sigma_theta[0] = sigma_z[0] = 0.0
    first, second = POSE_SIZE + 1, POSE_SIZE + 1 + seen.size
    theta[seen], z[seen] = fit.x[first:second], fit.x[second:]
    sigma_theta[seen], sigma_z[seen] = spread[first:second], spread[second:]
    return Refinement(
        pose=_moved(sightings.pose, fit.x[:POSE_SIZE]),
        theta=theta,
        z=z,
        sigma_theta=sigma_theta,
        sigma_z=sigma_z,
        residual=math.sqrt(2.0 * variance),
        sightings=len(sightings.marker),
    )


def _moved(pose: CameraPose, change: FloatArray) -> CameraPose:
    tilt, position = np.array(pose.tilt) + change[:3], np.array(pose.position) + change[3:]
    return CameraPose(
        tilt=(float(tilt[0]), float(tilt[1]), float(tilt[2])),
        position=(float(position[0]), float(position[1]), float(position[2])),
    )


def _pictures(
    view: CameraView, body: Body, azimuth: FloatArray, z: FloatArray, sightings: Sightings
) -> FloatArray:
    return _band_pictures(view, body, azimuth, z, sightings.slope, sightings.low, sightings.high)


@compiled
def _band_pictures(
    view: CameraView,
    body: Body,
    azimuth: FloatArray,
    z: FloatArray,
    slope: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:  # pragma: no cover
    """Return plane coordinates of the visible centroid of each sighting, shape (k, 2)."""
    out = np.empty((azimuth.size, 2))
    for k in range(azimuth.size):
        band = Band(azimuth[k], z[k], slope[k], low[k], high[k], math.inf, math.inf)
        out[k, 0], out[k, 1], _area = band_centroid(view, body, band)
    return out
