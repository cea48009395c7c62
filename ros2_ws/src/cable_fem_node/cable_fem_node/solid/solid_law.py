"""Material laws in three dimensions: stress and energy for a deformation gradient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.solid.solid_law_kernels import KINDS, piola
from winding_core.cable.material_law import MaterialLaw


@dataclass(frozen=True, kw_only=True)
class SolidLaw(MaterialLaw):
    """A law in three dimensions; its uniaxial response is the one it inherits."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.incompressible or self.poisson >= 0.5:
            raise ValueError("a solid needs a compressible law: poisson below 0.5")

    @classmethod
    def of(cls, law: MaterialLaw) -> SolidLaw:
        """Return the law in three dimensions whose uniaxial response is the given one."""
        return cls(**law.law_values(), young=law.young, poisson=law.poisson)

    @property
    def kind(self) -> int:
        """The kernel's number of the law."""
        return KINDS[self.law]

    @property
    def lame(self) -> float:
        """First Lame constant [Pa]."""
        return self.bulk_modulus - 2.0 / 3.0 * self.shear_modulus

    def constants(self) -> FloatArray:
        """Return G, lambda, K and the law's own coefficients [Pa]."""
        moduli = (self.shear_modulus, self.lame, self.bulk_modulus)
        return np.array([*moduli, *self.coefficients])

    def first_piola(self, gradient: ArrayLike) -> FloatArray:
        """Return the first Piola-Kirchhoff stress [Pa], shape (..., 3, 3), for F of that shape.

        Raises:
            ValueError: A gradient is not 3 x 3 or turns a volume inside out.
        """
        return self._evaluate(gradient)[0]

    def cauchy(self, gradient: ArrayLike) -> FloatArray:
        """Return the Cauchy stress P F^T / J [Pa], shape (..., 3, 3)."""
        f = np.asarray(gradient, dtype=float)
        stress = self.first_piola(f) @ np.swapaxes(f, -1, -2)
        return np.asarray(stress / np.linalg.det(f)[..., None, None])

    def _evaluate(self, gradient: ArrayLike) -> tuple[FloatArray, FloatArray]:
        f = np.ascontiguousarray(gradient, dtype=float)
        if f.shape[-2:] != (3, 3):
            raise ValueError(f"a deformation gradient has shape (..., 3, 3), got {f.shape}")
        flat = f.reshape(-1, 3, 3)
        stress = np.empty_like(flat)
        energy = np.empty(flat.shape[0])
        constants = self.constants()
        cof, one, two = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
        for n in range(flat.shape[0]):
            j, energy[n] = piola(self.kind, flat[n], constants, cof, one, two, stress[n])
            if not j > 0.0:
                raise ValueError(f"deformation gradient {n} has determinant {j:.4g}, not positive")
        return stress.reshape(f.shape), energy.reshape(f.shape[:-2])
