"""Uniaxial response of the material laws: what a stretched cable with free sides carries."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.cable.cases import Material
from winding_core.units import MEGAPASCAL

LAWS = ("linear", "hencky", "hencky_cauchy", "neo_hookean", "mooney_rivlin")

# Mooney-Rivlin splits the shear modulus as C01 / C10.
MOONEY_RATIO = 0.25

TABLE_LOW = 0.2
TABLE_HIGH = 4.0
TABLE_INTERVALS = 2048


class NoEquilibriumError(ValueError):
    """A dead load exceeds what the material law can carry at any stretch."""


@dataclass(frozen=True, kw_only=True)
class MaterialLaw:
    """A bar of unit reference section, pulled along its axis, free at its sides.

    The laws (axial stretch l, lateral stretch t, nominal stress P = force / reference area):

    - ``linear``: P = E (l - 1), t = 1 - nu (l - 1); the tensile test that gave E.
    - ``hencky``: Kirchhoff stress linear in the logarithmic strain, P = E ln(l) / l.
    - ``hencky_cauchy``: Cauchy stress linear in it, P = E ln(l) l^(-2 nu).
    - ``neo_hookean``, ``mooney_rivlin``: W = C10 (I1bar - 3) + C01 (I2bar - 3) + (J - 1)^2 / D1,
      C10 + C01 = G / 2, D1 = 2 / K, lateral stretch from zero lateral stress.

    Attributes:
        law: One of LAWS.
        young: E [Pa].
        poisson: nu; 0.5 only with `incompressible`.
        mooney_ratio: C01 / C10 of ``mooney_rivlin``.
        incompressible: Hold the volume exactly (``neo_hookean``, ``mooney_rivlin``):
            P = 2 (l - l^-2)(C10 + C01 / l).
    """

    law: str = "linear"
    young: float = Material.young
    poisson: float = Material.poisson
    mooney_ratio: float = MOONEY_RATIO
    incompressible: bool = False

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ValueError(f"law must be one of {', '.join(LAWS)}, got {self.law!r}")
        if not (math.isfinite(self.young) and self.young > 0.0):
            raise ValueError(f"young must be positive, got {self.young} Pa")
        if not 0.0 <= self.poisson <= 0.5:
            raise ValueError(f"poisson must lie in [0, 0.5], got {self.poisson}")
        if self.poisson == 0.5 and not self.incompressible and self._hyperelastic:
            raise ValueError("poisson 0.5 needs incompressible=True")
        if self.incompressible and not self._hyperelastic:
            raise ValueError(
                f"incompressible applies to neo_hookean and mooney_rivlin, not {self.law}"
            )

    @property
    def _hyperelastic(self) -> bool:
        return self.law in ("neo_hookean", "mooney_rivlin")

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def bulk_modulus(self) -> float:
        """K = E / (3 (1 - 2 nu)) [Pa]."""
        return self.young / (3.0 * (1.0 - 2.0 * self.poisson))

    def mooney_constants(self) -> tuple[float, float]:
        """Return (C10, C01) [Pa]; C01 is zero for every law but Mooney-Rivlin."""
        half = 0.5 * self.shear_modulus
        if self.law != "mooney_rivlin":
            return half, 0.0
        c10 = half / (1.0 + self.mooney_ratio)
        return c10, half - c10

    def lateral_stretch(self, stretch: ArrayLike) -> NDArray[np.float64]:
        """Return the lateral stretch of free sides, same shape as `stretch`."""
        axial = _positive_stretch(stretch)
        if self.law == "linear":
            return 1.0 - self.poisson * (axial - 1.0)
        if not self._hyperelastic:
            return np.power(axial, -self.poisson)
        if self.incompressible:
            return np.power(axial, -0.5)
        return self._free_lateral(axial)

    def nominal_stress(self, stretch: ArrayLike) -> NDArray[np.float64]:
        """Return force over reference area [Pa], same shape as `stretch`."""
        axial = _positive_stretch(stretch)
        if self.law == "linear":
            return self.young * (axial - 1.0)
        if self.law == "hencky":
            return self.young * np.log(axial) / axial
        if self.law == "hencky_cauchy":
            return self.young * np.log(axial) * np.power(axial, -2.0 * self.poisson)
        c10, c01 = self.mooney_constants()
        if self.incompressible:
            return 2.0 * (axial - axial**-2) * (c10 + c01 / axial)
        side = self._free_lateral(axial)
        volume = axial * side**2
        deviation = 4.0 / (3.0 * axial) * (axial**2 - side**2)
        return (
            deviation * (c10 * volume ** (-2.0 / 3.0) + c01 * side**2 * volume ** (-4.0 / 3.0))
            + self.bulk_modulus * (volume - 1.0) * side**2
        )

    def energy_density(self, stretch: ArrayLike) -> NDArray[np.float64]:
        """Return the strain energy per reference volume [J/m^3], same shape as `stretch`."""
        axial = _positive_stretch(stretch)
        if self.law == "linear":
            return 0.5 * self.young * (axial - 1.0) ** 2
        log = np.log(axial)
        if self.law == "hencky":
            return 0.5 * self.young * log**2
        if self.law == "hencky_cauchy":
            power = 1.0 - 2.0 * self.poisson
            if power == 0.0:
                return 0.5 * self.young * log**2
            return self.young * (axial**power * (log / power - power**-2) + power**-2)
        c10, c01 = self.mooney_constants()
        side = self.lateral_stretch(axial)
        volume = axial * side**2
        first = volume ** (-2.0 / 3.0) * (axial**2 + 2.0 * side**2)
        second = volume ** (-4.0 / 3.0) * (side**4 + 2.0 * axial**2 * side**2)
        energy = c10 * (first - 3.0) + c01 * (second - 3.0)
        if not self.incompressible:
            energy = energy + 0.5 * self.bulk_modulus * (volume - 1.0) ** 2
        return np.asarray(energy, dtype=float)

    def limit(self) -> tuple[float, float]:
        """Return (greatest nominal stress [Pa] on the rising branch, its stretch).

        Infinite for laws that never fall: linear, Neo-Hookean, Mooney-Rivlin.
        """
        if self.law == "hencky":
            return self.young / math.e, math.e
        if self.law == "hencky_cauchy" and self.poisson > 0.0:
            power = 2.0 * self.poisson
            return self.young / (power * math.e), math.exp(1.0 / power)
        return math.inf, math.inf

    def stretch_at(self, nominal_stress: float) -> float:
        """Return the stretch that carries a dead nominal stress [Pa] (tension or compression).

        Raises:
            NoEquilibriumError: The stress exceeds the law's limit load.
            ValueError: The stretch would leave the tabulated range.
        """
        highest, at = self.limit()
        if nominal_stress > highest:
            raise NoEquilibriumError(
                f"law {self.law} carries at most {highest / MEGAPASCAL:.4g} MPa of dead nominal "
                f"stress (at stretch {at:.4g}), got {nominal_stress / MEGAPASCAL:.4g} MPa: "
                "no equilibrium exists"
            )
        if self.law == "linear":
            return 1.0 + nominal_stress / self.young
        low, high = TABLE_LOW, min(at, TABLE_HIGH)
        if (
            not float(self.nominal_stress(low))
            <= nominal_stress
            <= float(self.nominal_stress(high))
        ):
            raise ValueError(
                f"nominal stress {nominal_stress / MEGAPASCAL:.4g} MPa needs a stretch outside "
                f"{low:g} to {high:.4g}, the range of the solver's tables"
            )
        for _ in range(200):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            if float(self.nominal_stress(middle)) < nominal_stress:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)

    def table(self) -> NDArray[np.float64]:
        """Return the response on the uniform grid of TABLE_LOW..TABLE_HIGH, shape (intervals, 5).

        Columns 0..3: coefficients of the cubic in u = 0..1 that gives the nominal stress [Pa]
        in each interval (Hermite, exact to 1e-9 E); column 4: energy density [J/m^3] at its left.
        """
        grid = np.linspace(TABLE_LOW, TABLE_HIGH, TABLE_INTERVALS + 1)
        spacing = (TABLE_HIGH - TABLE_LOW) / TABLE_INTERVALS
        step = 1.0e-5
        slope = self.nominal_stress(grid + step) - self.nominal_stress(grid - step)
        slope *= spacing / (2.0 * step)
        stress = self.nominal_stress(grid)
        rise = np.diff(stress)
        left, right = slope[:-1], slope[1:]
        return np.column_stack(
            [
                stress[:-1],
                left,
                3.0 * rise - 2.0 * left - right,
                left + right - 2.0 * rise,
                self.energy_density(grid[:-1]),
            ]
        )

    def tangent(self, stretch: float) -> float:
        """Return dP/dl [Pa] at a stretch."""
        step = 1.0e-5
        low, high = self.nominal_stress(np.array([stretch - step, stretch + step]))
        return float(high - low) / (2.0 * step)

    def _free_lateral(self, axial: NDArray[np.float64]) -> NDArray[np.float64]:
        c10, c01 = self.mooney_constants()
        bulk = self.bulk_modulus

        def lateral_stress(side: NDArray[np.float64]) -> NDArray[np.float64]:
            volume = axial * side**2
            deviation = 4.0 / 3.0 * (side**2 - axial**2)
            return np.asarray(
                deviation
                * (c10 * volume ** (-2.0 / 3.0) / side + c01 * side * volume ** (-4.0 / 3.0))
                + 2.0 * bulk * (volume - 1.0) * axial * side
            )

        low, high = 0.3 * axial**-0.5, 3.0 * axial**-0.5
        for _ in range(60):
            middle = 0.5 * (low + high)
            below = lateral_stress(middle) < 0.0
            low = np.where(below, middle, low)
            high = np.where(below, high, middle)
        return 0.5 * (low + high)


def _positive_stretch(stretch: ArrayLike) -> NDArray[np.float64]:
    axial = np.asarray(stretch, dtype=float)
    if not np.all(axial > 0.0):
        raise ValueError(f"stretch must be positive, got {float(np.min(axial))}")
    return axial
