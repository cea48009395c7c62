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
        tilt = (pose.tilt[0] + turn[0], pose.tilt[1] + turn[1], pose.tilt[2])
        view = camera.view(replace(pose, tilt=tilt))
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
    return replace(
        pose, tilt=(pose.tilt[0] + float(turn[0]), pose.tilt[1] + float(turn[1]), pose.tilt[2])
    )
