"""What a wrong number of machine or camera would make of the bands: where they seem, how large."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from marker_tracker_node.camera.pinhole import CameraView
from marker_tracker_node.detection.band import Band, Body, band_centroid, solve_band

# Change of a number whose effect is looked at; effects are straight over several percent.
_STEP = 0.01
_AZIMUTHS = np.linspace(-0.9, 0.9, 19)


class Signature(NamedTuple):
    """What the bands tell of the geometry, or what a wrong number changes of it.

    Attributes:
        motion: Logarithm of seen azimuth per azimuth.
        area: Logarithm of seen area per expected area.
    """

    motion: float
    area: float


def signatures(view: CameraView, body: Body) -> Mapping[str, Signature]:
    """Return, by the name of the number, what telling it one percent too large changes.

    The focal length and the camera's distance do the same, with opposite signs.

    Args:
        view: The camera as told.
        body: What the bands are painted on, as told.
    """
    radius = body.rho - body.cable_radius
    smaller = 1.0 / (1.0 + _STEP)
    thinner = body.cable_radius * smaller
    truths = {
        "cylinder_diameter": body._replace(rho=radius * smaller + body.cable_radius),
        "cable_diameter": body._replace(rho=radius + thinner, cable_radius=thinner),
        "band_width": body._replace(half_band=body.half_band * smaller),
    }
    found = {name: _seen(view, truth, body, 1.0) for name, truth in truths.items()}
    found["focal_length"] = _seen(view, body, body, smaller)
    right = _seen(view, body, body, 1.0)
    return {
        name: Signature(one.motion - right.motion, one.area - right.area)
        for name, one in found.items()
    }


def _seen(view: CameraView, truth: Body, told: Body, focal: float) -> Signature:
    """Return what a tracker that was told one body sees of another.

    Args:
        view: The camera.
        truth: What is there.
        told: What the tracker believes.
        focal: True focal length over the told one.
    """
    azimuths, shares = [], []
    for azimuth in _AZIMUTHS.tolist():
        a, b, area = band_centroid(view, truth, Band(azimuth, 0.0, 0.0))
        start = Band(azimuth, 0.0, 0.0)
        seen, z = solve_band(view, told, focal * a, focal * b, start)
        expected = band_centroid(view, told, start._replace(azimuth=seen, z=z))[2]
        azimuths.append(seen)
        shares.append(focal**2 * area / expected)
    slope = np.polyfit(_AZIMUTHS, azimuths, 1)[0]
    return Signature(float(np.log(slope)), float(np.log(shares).mean()))
