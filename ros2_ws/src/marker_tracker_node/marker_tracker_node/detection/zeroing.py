"""Turning the camera, on paper, until P0 stands where it is known to stand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera, plane_of_pixel
from marker_tracker_node.detection.band import Band, Body, band_centroid

FloatArray = NDArray[np.float64]

NEWTON_STEPS = 6
SMALL_TURN = 1.0e-6
# A single frame cannot improve a pose that explains it this well.
TRUSTED_PIXELS = 0.5
# Of a pass: scatter of a centroid on the plane with what frames have in common, and what is
# believed before it of both turns and of the encoder's zero, clocks included [rad].
SCATTER = 2.0e-4
BELIEFS = np.array([0.02, 0.02, 0.1])


def zeroed_pose(
    camera: PinholeCamera,
    pose: CameraPose,
    body: Body,
    pixel: tuple[float, float],
    angle: float,
) -> CameraPose:
    """Return the pose, turned about the camera's x and y axes, that explains P0's picture.

    One frame holds two numbers of P0, and its place is known: two of the pose's unknowns follow.
    An uncorrected milliradian would shift every wound angle by 20 on a small cylinder.

    Args:
        camera: The camera.
        pose: Nominal.
        body: What the band is painted on.
        pixel: Column and row of the centroid of P0's band [pixels].
        angle: Azimuth of P0, the cylinder angle [rad].
    """
    goal = np.array(plane_of_pixel(camera.view(pose), *pixel))

    def seen(turn: FloatArray) -> FloatArray:
        view = camera.view(tilted(pose, turn))
        return np.array(band_centroid(view, body, Band(azimuth=angle, z=0.0, slope=0.0))[:2])

    turn = np.zeros(2)
    focal = math.sqrt(camera.k[0, 0] * camera.k[1, 1]) / camera.binning
    if np.linalg.norm(seen(turn) - goal) * focal < TRUSTED_PIXELS:
        return pose
    for _ in range(NEWTON_STEPS):
        residual = seen(turn) - goal
        slope = np.column_stack(
            [(seen(turn + step) - seen(turn)) / SMALL_TURN for step in SMALL_TURN * np.eye(2)]
        )
        turn -= np.linalg.solve(slope, residual)
    return tilted(pose, turn)


def pass_turn(
    camera: PinholeCamera, nominal: CameraPose, used: CameraPose, body: Body, rows: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the turn about the camera's x and y axes that explains a pass of P0, and its error.

    A turn shifts the picture as a whole, a wrong zero of the encoder shifts it less the further
    P0 has come round: a pass tells them apart as far as it reaches to the side.

    Args:
        camera: The camera.
        nominal: Pose that is turned.
        used: Pose with which P0 was measured.
        body: What the band is painted on.
        rows: Time [s], angle of the cylinder [rad], and azimuth, z, slope, low and high of P0's
            band (see `Band`) of each frame, shape (k, 7).

    Returns:
        Turn [rad] and one standard deviation, each of shape (2,).
    """
    with_used = camera.view(used)
    goal = np.array([band_centroid(with_used, body, Band(*row[2:]))[:2] for row in rows])

    def residuals(x: FloatArray) -> FloatArray:
        view = camera.view(tilted(nominal, x))
        seen = [band_centroid(view, body, Band(row[1] + x[2], 0.0, *row[4:]))[:2] for row in rows]
        return np.concatenate([(np.array(seen) - goal).ravel() / SCATTER, x / BELIEFS])

    x = np.zeros(3)
    slope = np.eye(3)
    for _ in range(NEWTON_STEPS):
        off = residuals(x)
        slope = np.column_stack(
            [(residuals(x + step) - off) / SMALL_TURN for step in SMALL_TURN * np.eye(3)]
        )
        # Half hidden bands appear beside their place.
        weight = 1.0 / np.sqrt(1.0 + off**2)
        slope, off = slope * weight[:, None], off * weight
        x = x - np.linalg.lstsq(slope, off, rcond=None)[0]
    sigma = np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))
    return x[:2], sigma[:2]


def tilted(pose: CameraPose, turn: FloatArray) -> CameraPose:
    """Return a pose turned about the camera's x and y axes [rad]."""
    x, y, z = pose.tilt
    return replace(pose, tilt=(x + float(turn[0]), y + float(turn[1]), z))
