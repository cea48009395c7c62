"""Camera and body as they are if the configured numbers are set too large by so much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.detection.band import Body
from marker_tracker_node.tracking.estimator.numbers import (
    BAND,
    CABLE,
    CYLINDER,
    FOCAL,
    NUMBERS,
    TILT,
)

# A step of the fit may lead beyond, where a number has no logarithm.
LEAST = np.array([-number.most for number in NUMBERS])


def pose_without(pose: CameraPose, errors: FloatArray) -> CameraPose:
    """Return a configured pose without its errors, see `NUMBERS`, shape (numbers,)."""
    return CameraPose.of(pose.numbers - errors[TILT : TILT + 6])


def camera_without(camera: PinholeCamera, errors: FloatArray) -> PinholeCamera:
    """Return a configured camera without the error of its focal length."""
    k = camera.k.copy()
    k[[0, 1], [0, 1]] /= 1.0 + float(errors[FOCAL])
    return replace(camera, k=k)


def body_without(body: Body, errors: FloatArray) -> Body:
    """Return what is configured of cylinder, cable and bands without its errors."""
    cylinder, cable, band = (
        1.0 + max(float(errors[k]), float(LEAST[k])) for k in (CYLINDER, CABLE, BAND)
    )
    r = body.cable_radius / cable
    radius = (body.rho - body.cable_radius) / cylinder
    return body._replace(rho=radius + r, cable_radius=r, half_band=body.half_band / band)
