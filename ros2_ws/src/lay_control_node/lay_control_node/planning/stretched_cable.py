"""How much cable is laid per angle under a pull: stretch, bending and build-up, in closed form."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from winding_core.condition import ResolvedCondition
from winding_core.material_law import MaterialLaw

Array = NDArray[np.float64]

_STRETCHES = np.linspace(0.7, 3.5, 4000)
# Pulls are planned up to this share of what the material carries at all.
_OF_LIMIT = 0.98


@dataclass(frozen=True, kw_only=True)
class StretchedCable:
    """A cable that is laid under its span's tension, less what bending takes, and sticks.

    Attributes:
        what: What is wound.
    """

    what: ResolvedCondition
    _stretch: Array = field(init=False, repr=False)
    _force: Array = field(init=False, repr=False)
    _radius: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        case = self.what.case
        case.material.refuse_fading("a plan of the lay")
        law = MaterialLaw(
            law=self.what.law,
            young=case.material.young,
            poisson=case.material.poisson,
            mooney_ratio=self.what.mooney_ratio,
        )
        stretch = _STRETCHES[law.limit()[1] >= _STRETCHES]
        lateral = law.lateral_stretch(stretch)
        # As the solver has it: the linear law leaves the section as it is.
        if law.law == "linear":
            lateral = np.ones_like(lateral)
        object.__setattr__(self, "_stretch", stretch)
        object.__setattr__(self, "_force", case.axial_area * law.nominal_stress(stretch))
        object.__setattr__(self, "_radius", case.cylinder_radius + case.cable_radius * lateral)

    @property
    def wound_radius(self) -> float:
        """Centreline radius of cable that is laid under the weight [m]."""
        weight = np.array([self.what.case.weight])
        span = self.span_tension(weight, np.array([1.0e9]))
        return float(self._at_force(span, self._radius)[0])

    def span_tension(self, pull: Array, wound_angle: Array) -> Array:
        """Return the span's tension [N] under pulls at the guide [N] at wound angles [rad]."""
        case = self.what.case
        wound = case.centreline_radius * wound_angle
        return self.what.tension_law.along(pull, case.cylinder_diameter, wound)

    def per_radian(self, pull: Array, wound_angle: Array, slope: Array) -> Array:
        """Return the undeformed cable laid per radian [m].

        Args:
            pull: At the guide [N], shape (n,).
            wound_angle: [rad], shape (n,).
            slope: dz/dtheta of the lay [m/rad], shape (n,).
        """
        case = self.what.case
        span = self.span_tension(pull, wound_angle)
        stretch = self._at_force(span, self._stretch)
        bent = 0.5 * case.bending_stiffness * stretch / self._at_force(span, self._radius) ** 2
        laid = span - bent
        return np.asarray(
            np.hypot(self._at_force(laid, self._radius), slope)
            / self._at_force(laid, self._stretch)
        )

    def highest_pull(self, wanted: float) -> float:
        """Return the largest pull [N] up to a wanted one that the material carries."""
        most = _OF_LIMIT * float(self._force[-1])
        low, high = 0.0, wanted
        built = np.array([1.0e9])
        if float(self.span_tension(np.array([wanted]), built)[0]) <= most:
            return wanted
        for _ in range(60):
            middle = 0.5 * (low + high)
            if float(self.span_tension(np.array([middle]), built)[0]) <= most:
                low = middle
            else:
                high = middle
        return low

    def _at_force(self, force: Array, values: Array) -> Array:
        return np.interp(force, self._force, values)
