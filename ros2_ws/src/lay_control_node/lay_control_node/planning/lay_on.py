"""How much undeformed cable lies on a radian of the cylinder under a tension, and the reverse."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_core.cable.material_law import MaterialLaw

Array = NDArray[np.float64]

_FORCES = 2000
# A span that pulls less than bending takes leaves the cable short.
_SMALLEST_STRETCH = 0.9
# A cable stretched further than this is not wound.
_LARGEST_STRETCH = 3.5


class LayOnLaw:
    """Cable lies down with the stretch of its tension, less EI l / (2 rho^2) for bending.

    The same closed form as `winding_core.lay.quasi_static`, as a table over the tension.

    Args:
        case: What is wound.
        law: Material of the cable.

    Attributes:
        largest: Largest tension of the table [N].
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
        self.largest = float(self._force[-1])

    def stretch(self, force: float | Array) -> Array:
        """Return the stretch of laid cable under tensions of the span [N], same shape."""
        return np.asarray(np.interp(force, self._force, self._stretch))

    def radius(self, force: float | Array) -> Array:
        """Return the centreline radius of laid cable [m] under tensions of the span [N]."""
        return np.asarray(np.interp(force, self._force, self._radius))

    def density(self, force: float | Array, slope: float | Array) -> Array:
        """Return undeformed length per wound angle [m/rad].

        Args:
            force: Tension of the span [N].
            slope: dz/dtheta [m/rad], broadcast with it.
        """
        return np.asarray(np.hypot(self.radius(force), slope) / self.stretch(force))

    def force_for(self, density: float, slope: float) -> float:
        """Return the tension [N] under which a density [m/rad] is laid at a slope [m/rad].

        Nearest end of the table where none does.
        """
        laid = np.hypot(self._radius, slope) / self._stretch
        return float(np.interp(-density, -laid, self._force))
