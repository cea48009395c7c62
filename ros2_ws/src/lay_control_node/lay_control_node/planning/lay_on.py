"""How much undeformed cable lies on a radian of the cylinder under a tension or a pull."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_core.cable.condition import ResolvedCondition
from winding_core.cable.material_law import MaterialLaw

Array = NDArray[np.float64]

_FORCES = 2000
_SMALLEST_STRETCH = 0.9  # A span that pulls less than bending takes leaves the cable short
_LARGEST_STRETCH = 3.5  # A cable stretched further than this is not wound


class LayOnLaw:
    """Cable lies down with the stretch of its tension, less EI l / (2 rho^2) for bending.

    The same closed form as `winding_core.lay.quasi_static`, as a table over the tension.
    """

    def __init__(self, case: Case, law: MaterialLaw) -> None:
        _, limit = law.limit()
        stretch = np.linspace(_SMALLEST_STRETCH, min(_LARGEST_STRETCH, 0.999 * limit), _FORCES)
        lateral = np.ones_like(stretch) if law.law == "linear" else law.lateral_stretch(stretch)
        force = law.nominal_stress(stretch) * case.axial_area
        radius = case.cylinder_radius + case.cable_radius * lateral
        bending = 0.5 * case.bending_stiffness * stretch / radius**2
        # Against the tension of the span, of which bending takes a part at lay-on.
        self._force = force + bending
        self._stretch = stretch
        self._radius = radius
        self.largest = float(self._force[-1])  # Largest tension of the table [N]

    def stretch(self, force: float | Array) -> Array:
        """Return the stretch of laid cable under tensions of the span [N], same shape."""
        return np.asarray(np.interp(force, self._force, self._stretch))

    def radius(self, force: float | Array) -> Array:
        """Return the centreline radius of laid cable [m] under tensions of the span [N]."""
        return np.asarray(np.interp(force, self._force, self._radius))

    def density(
        self, force: float | Array, slope: float | Array, raised: float | Array = 0.0
    ) -> Array:
        """Return undeformed length per wound angle [m/rad].

        Args:
            force: Tension of the span [N].
            slope: dz/dtheta [m/rad], broadcast with it.
            raised: Height above cable on the bare cylinder [m], broadcast with it.
        """
        return np.asarray(np.hypot(self.radius(force) + raised, slope) / self.stretch(force))


_OF_LIMIT = 0.98  # Pulls are planned up to this share of what the material carries at all
_BUILT = 1.0e9  # A wound angle at which every build-up has ended [rad]


@dataclass(frozen=True, kw_only=True)
class StretchedCable:
    """A cable that is laid under its span's tension, less what bending takes, and sticks."""

    what: ResolvedCondition  # What is wound
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

    def stretch(self, pull: Array) -> Array:
        """Return the stretch of laid cable far from P0 under pulls at the guide [N], same shape."""
        return self._law.stretch(self.span_tension(pull, np.full(pull.shape, _BUILT)))

    def per_radian(
        self, pull: Array, wound_angle: Array, slope: Array, raised: float | Array = 0.0
    ) -> Array:
        """Return the undeformed cable laid per radian [m].

        Args:
            pull: At the guide [N], shape (n,).
            wound_angle: [rad], shape (n,).
            slope: dz/dtheta of the lay [m/rad], shape (n,).
            raised: Height above cable on the bare cylinder [m], one or shape (n,).
        """
        return self._law.density(self.span_tension(pull, wound_angle), slope, raised)

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
