"""Geometry of a cable laid as a helix on a cylinder (paper, Eqs. 1-3)."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatOrArray = TypeVar("FloatOrArray", float, NDArray[np.float64])


def lead_angle(pitch: float, radius: float) -> float:
    """Return the lead angle [rad] of a helix (Eq. 1: tan(lambda) = l / (2 pi R)).

    Args:
        pitch: Axial advance per turn [m].
        radius: Cylinder radius R [m].
    """
    _require_positive("radius", radius)
    return math.atan2(pitch, 2.0 * math.pi * radius)


def pitch(lead_angle: float, radius: float) -> float:
    """Return the axial advance per turn [m] (Eq. 2: l = 2 pi R tan(lambda))."""
    _require_positive("radius", radius)
    return 2.0 * math.pi * radius * math.tan(lead_angle)


def turn_length(radius: float, pitch: float) -> float:
    """Return the cable length of one turn [m], the marker spacing of Eq. 3.

    The paper prints sqrt(2 pi (R+r)^2 + l^2); the square belongs around the whole
    circumference, as Tables 5 and 6 show: sqrt((2 pi (R+r))^2 + l^2).

    Args:
        radius: Centreline radius R + r [m].
        pitch: Axial advance per turn [m].
    """
    _require_positive("radius", radius)
    return math.hypot(2.0 * math.pi * radius, pitch)


def curve_length(radius: float, theta: FloatOrArray, z: FloatOrArray) -> FloatOrArray:
    """Return S_n [m], the length of the straight helix from P0 to (theta_n, z_n).

    Tables 5 and 6 use the undeformed centreline radius R + r.

    Args:
        radius: Centreline radius R + r [m].
        theta: Wound angle relative to P0 [rad], unwrapped; scalar or array.
        z: Axial position relative to P0 [m], same shape.
    """
    _require_positive("radius", radius)
    return like(theta, np.hypot(radius * np.asarray(theta), z))


def like(example: FloatOrArray, values: NDArray[np.float64]) -> FloatOrArray:
    """Return values of any unit as an array for an array example, as a float for a scalar one."""
    if isinstance(example, np.ndarray):
        return values
    return float(values)


def _require_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite, got {value}")
