"""General solid model: one-point hexahedra (C3D8R) under the loads and contact of any model."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.dynamics.model import ExplicitModel
from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from cable_fem_node.solid.hex_geometry import greatest_stiffness, hex_geometry
from cable_fem_node.solid.hex_kernels import HexMesh, advance_solid, hex_forces
from cable_fem_node.solid.solid_law import SolidLaw
from winding_core.cable.cases import Material


class Solid(ExplicitModel):
    """A solid of eight-node hexahedra with one integration point and hourglass control.

    Args:
        nodes: (n, 3) [m].
        hexes: (m, 8), bottom four then top four.
        law: Material law.
        density: [kg/m^3]
        hourglass: Hourglass stiffness as a share of the shear modulus; scaling with the bulk
            modulus would lock bending.
        hourglass_drag: Viscous hourglass control, as a share of critical damping.
        bulk_viscosity: Linear bulk viscosity b1.
    """

    def __init__(
        self,
        nodes: ArrayLike,
        hexes: ArrayLike,
        law: SolidLaw,
        *,
        density: float = Material.density,
        hourglass: float = 0.1,
        hourglass_drag: float = 0.0,
        bulk_viscosity: float = 0.06,
    ) -> None:
        place = np.asarray(nodes, dtype=float)
        corners = np.ascontiguousarray(hexes, dtype=np.int64)
        if corners.ndim != 2 or corners.shape[1] != 8:
            raise ValueError(f"hexes have shape (m, 8), got {corners.shape}")
        if corners.min() < 0 or corners.max() >= place.shape[0]:
            raise ValueError(f"hexes name nodes outside 0 to {place.shape[0] - 1}")
        if law.law == "hencky_cauchy":
            raise ValueError("a solid needs a law with stored energy; hencky_cauchy has none")
        for name, value in (("hourglass", hourglass), ("hourglass_drag", hourglass_drag)):
            if not value >= 0.0:
                raise ValueError(f"{name} must not be negative, got {value}")
        if not density > 0.0:
            raise ValueError(f"density must be positive, got {density}")
        volume, gradient, gamma = hex_geometry(place[corners])
        mass = np.zeros(place.shape[0])
        np.add.at(mass, corners, (density * volume / 8.0)[:, None])
        if not np.all(mass > 0.0):
            raise ValueError(f"node {int(np.argmin(mass))} belongs to no element")
        super().__init__(place, mass)
        self.law = law
        self.density = density
        square = (gradient**2).sum(axis=(1, 2))
        stiffness = hourglass * law.shear_modulus * volume * square / 8.0
        speed = math.sqrt((law.lame + 2.0 * law.shear_modulus) / density)
        own = density * volume / 8.0
        reserve = law.shear_modulus * volume * square / 8.0
        self._stiffest = greatest_stiffness(volume, gradient, law.shear_modulus, law.lame)
        self._element_mass = own
        self._bulk_viscosity = bulk_viscosity
        self._mesh = HexMesh(
            hexes=corners,
            volume=volume,
            gradient=np.ascontiguousarray(gradient),
            gamma=np.ascontiguousarray(gamma),
            hourglass=stiffness,
            hourglass_drag=2.0 * hourglass_drag * np.sqrt(reserve * own / 8.0),
            bulk_drag=bulk_viscosity * density * speed * np.cbrt(volume),
            law=law.kind,
            constants=law.constants(),
        )
        self._net = np.zeros((3, place.shape[0]))

    @property
    def hexes(self) -> NDArray[np.int64]:
        """Node numbers of the elements (m, 8)."""
        return self._mesh.hexes

    @property
    def volumes(self) -> FloatArray:
        """Reference volumes (m,) [m^3]."""
        return self._mesh.volume

    def gradients(self) -> FloatArray:
        """Return the deformation gradient of every element (m, 3, 3)."""
        place = self.points.position[:, self._mesh.hexes]
        return np.asarray(np.einsum("ima,mak->mik", place, self._mesh.gradient))

    def stresses(self) -> FloatArray:
        """Return the Cauchy stress of every element (m, 3, 3) [Pa]."""
        return self.law.cauchy(self.gradients())

    def internal_forces(self, nodes: ArrayLike | None = None) -> FloatArray:
        """Return the elements' forces on the nodes (n, 3) [N], hourglass control included."""
        self._forces(nodes)
        return self._net.T.copy()

    def internal_energy(self) -> float:
        """Return strain and hourglass energy [J]."""
        stored, wavy = self._forces(None)
        return stored + wavy

    def hourglass_energy(self) -> float:
        """Return the hourglass energy [J]."""
        return self._forces(None)[1]

    def critical_step(self) -> float:
        """Return a safe stable step [s]: no element's own critical step is exceeded.

        Element eigenvalues bound the mesh's; deformation counts by its smallest stretch.
        """
        longest = 8.0 * self._mesh.hourglass
        omega2 = np.maximum(self._stiffest, longest) / self._element_mass
        least = np.linalg.svd(self.gradients(), compute_uv=False)[:, -1]
        step = float((2.0 / np.sqrt(omega2) * np.minimum(least, 1.0)).min())
        damped = self._bulk_viscosity
        if self._contact is not None:
            touch = self._contact_law()
            most = (omega2 * self._element_mass).max() + touch.normal_stiffness
            lightest = float(self._element_mass.min())
            ratio = 0.5 * touch.normal_damping / math.sqrt(touch.normal_stiffness * lightest)
            damped += ratio
            step = min(step, 2.0 * math.sqrt(lightest / float(most)))
        # The bound is exact for a single cube; a thousandth keeps rounding on the safe side.
        return 0.999 * step * (math.sqrt(1.0 + damped**2) - damped)

    def contact_stiffness(self) -> float:
        """Return the normal penalty: E times the typical size of an element [N/m]."""
        return self.law.young * float(np.cbrt(np.median(self._mesh.volume)))

    def _forces(self, nodes: ArrayLike | None) -> tuple[float, float]:
        place = self.points.position
        if nodes is not None:
            place = np.ascontiguousarray(np.asarray(nodes, dtype=float).T)
        at, stored, wavy, _ = hex_forces(place, self.points.velocity, self._mesh, False, self._net)
        if at >= 0:
            raise DivergenceError(f"element {at} is inside out at t = {self.time:.6g} s")
        return float(stored), float(wavy)

    def _march(self, steps: int, dt: float, calming: bool) -> None:
        couple = np.zeros(self.mass.size)
        at, self._kinetic = advance_solid(
            steps,
            dt,
            self.time,
            self.points,
            self._mesh,
            self._net,
            couple,
            self._boundary_conditions(calming),
            self._contact_law(),
            self._ledger,
        )
        if at >= 0:
            raise DivergenceError(
                f"the solid diverged before t = {self.time + steps * dt:.6g} s at element {at}: "
                f"negative Jacobian (step {dt:.3g} s)"
            )
