"""Quasi-static lay-on: where a sticking cable lies under any span tension, without a solver."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_core.cable.material_law import MaterialLaw
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw, curve_length
from winding_core.machine.drive import DriveProfile
from winding_core.machine.tension import DeadWeight, RigTension

Array = NDArray[np.float64]

_ANGLE_STEP = 0.05
_STRETCHES = 4000
_STRETCH_RANGE = (0.7, 3.5)


class QuasiStaticLay:
    """Quasi-static angles of the markers of one case under any span tension.

    Cable lies down at rho dtheta with the stretch that the span's tension gives it, less
    EI l / (2 rho^2) for bending, along the path of the fleet-angle law, and sticks. This is what
    the rod does without inertia, in closed form up to one integral.

    Args:
        case: What is wound.
        law: Material law, one of `uniaxial.LAWS`; ``linear`` leaves the section as it is.
    """

    def __init__(self, case: Case, law: str) -> None:
        self.case = case
        self._stretch, self._stress, self._lateral = _tabulated(
            MaterialLaw(law=law, young=case.material.young, poisson=case.material.poisson)
        )
        if law == "linear":
            self._lateral = np.ones_like(self._lateral)
        # No measured cable is stretched to more than twice its length or lies closer.
        reach = 2.0 * case.original_length(case.marker_count) / case.centreline_radius
        self._theta = np.arange(0.0, reach, _ANGLE_STEP)
        self._path = FleetAngleLaw(
            advance_per_radian=DriveProfile().advance_per_radian,
            free_length=PAPER_FREE_LENGTH,
            radius=case.centreline_radius,
        )
        self._slope = self._path.slope(self._theta)

    def theta(self, tension: DeadWeight | RigTension) -> Array:
        """Return the wound angle of each marker [rad], shape (marker_count,)."""
        case = self.case
        span = tension.along(
            case.weight, case.cylinder_diameter, case.centreline_radius * self._theta
        )
        stretch = self._at(span)
        bent = 0.5 * case.bending_stiffness * stretch / self._radius(stretch) ** 2
        stretch = self._at(span - bent)
        reference_per_radian = np.hypot(self._radius(stretch), self._slope) / stretch
        between = 0.5 * (reference_per_radian[1:] + reference_per_radian[:-1]) * _ANGLE_STEP
        laid = np.concatenate([[0.0], np.cumsum(between)])
        markers = case.marker_spacing * np.arange(1, case.marker_count + 1)
        return np.asarray(np.interp(markers, laid, self._theta))

    def curve_lengths(self, tension: DeadWeight | RigTension) -> Array:
        """Return S_n of each marker [m], shape (marker_count,)."""
        theta = self.theta(tension)
        return np.asarray(curve_length(self.case.centreline_radius, theta, self._path.z(theta)))

    def _at(self, force: Array) -> Array:
        return np.interp(force / self.case.axial_area, self._stress, self._stretch)

    def _radius(self, stretch: Array) -> Array:
        lateral = np.interp(stretch, self._stretch, self._lateral)
        return np.asarray(self.case.cylinder_radius + self.case.cable_radius * lateral)


@lru_cache(maxsize=16)
def _tabulated(law: MaterialLaw) -> tuple[Array, Array, Array]:
    low, high = _STRETCH_RANGE
    _, limit = law.limit()
    stretch = np.linspace(low, min(high, limit), _STRETCHES)
    return stretch, law.nominal_stress(stretch), law.lateral_stretch(stretch)
