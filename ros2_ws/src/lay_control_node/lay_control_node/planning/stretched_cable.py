"""How much cable is laid per angle under a pull: stretch, bending and build-up, in closed form."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.condition import ResolvedCondition

Array = NDArray[np.float64]

# Pulls are planned up to this share of what the material carries at all.
_OF_LIMIT = 0.98
# A wound angle at which every build-up has ended [rad].
_BUILT = 1.0e9


@dataclass(frozen=True, kw_only=True)
class StretchedCable:
    """A cable that is laid under its span's tension, less what bending takes, and sticks.

    Attributes:
        what: What is wound.
    """

    what: ResolvedCondition
    _law: LayOnLaw = field(init=False, repr=False)

    def __post_init__(self) -> None:
        case = self.what.case
        case.material.refuse_fading("a plan of the lay")
        law = self.what.material_law(case.material.young, case.material.poisson)
        object.__setattr__(self, "_law", LayOnLaw(case, law))

    @property
    def wound_radius(self) -> float:
        """Centreline radius of cable that is laid under the weight [m]."""
        span = self.span_tension(np.array([self.what.case.weight]), np.array([_BUILT]))
        return float(self._law.radius(span)[0])

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
        return self._law.density(self.span_tension(pull, wound_angle), slope)

    def highest_pull(self, wanted: float) -> float:
        """Return the largest pull [N] up to a wanted one that the material carries."""
        most = _OF_LIMIT * self._law.largest
        low, high = 0.0, wanted
        built = np.array([_BUILT])
        if float(self.span_tension(np.array([wanted]), built)[0]) <= most:
            return wanted
        for _ in range(60):
            middle = 0.5 * (low + high)
            if float(self.span_tension(np.array([middle]), built)[0]) <= most:
                low = middle
            else:
                high = middle
        return low
