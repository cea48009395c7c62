"""Round section and material of a general rod."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.cable.cases import Material
from winding_core.cable.material_law import MaterialLaw


@dataclass(frozen=True, kw_only=True)
class RodSection:
    """Round section and material of a rod.

    Attributes:
        diameter: Undeformed [m].
        law: Axial law; bending and torsion are linear in E and G.
        young: E [Pa].
        poisson: nu.
        density: [kg/m^3]
        bending_factor: Factor on EI, e.g. 1e-3 for a cable that shall only pull.
    """

    diameter: float
    law: str = "linear"
    young: float = Material.young
    poisson: float = Material.poisson
    density: float = Material.density
    bending_factor: float = 1.0

    def __post_init__(self) -> None:
        for name in ("diameter", "young", "density"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")

    @property
    def uniaxial(self) -> MaterialLaw:
        """The axial law."""
        return MaterialLaw(
            law=self.law,
            young=self.young,
            poisson=self.poisson,
        )

    @property
    def area(self) -> float:
        """[m^2]."""
        return 0.25 * math.pi * self.diameter**2

    @property
    def bending(self) -> float:
        """EI [N m^2], with the factor."""
        return self.bending_factor * self.young * math.pi * self.diameter**4 / 64.0

    @property
    def torsion(self) -> float:
        """GJ [N m^2]."""
        return self.uniaxial.shear_modulus * math.pi * self.diameter**4 / 32.0
