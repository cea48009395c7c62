"""Material laws: their own parameters, and what a stretched cable with free sides carries."""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.cable.cases import Material
from winding_core.parameters import parameter
from winding_core.units import MEGAPASCAL, PLAIN

Array = NDArray[np.float64]
Values = float | Array  # What is constant, or one value per stretch

TABLE_LOW = 0.2
TABLE_HIGH = 4.0
TABLE_INTERVALS = 2048


class NoEquilibriumError(ValueError):
    """A dead load exceeds what the material law can carry at any stretch."""


class Law(ABC):
    """One law in uniaxial tension; l is the axial stretch, t the lateral one."""

    hyperelastic = False

    @abstractmethod
    def lateral_stretch(self, bar: MaterialLaw, axial: Array) -> Array:
        """Return t of free sides, same shape as `axial`."""

    @abstractmethod
    def nominal_stress(self, bar: MaterialLaw, axial: Array) -> Array:
        """Return force over reference area [Pa], same shape as `axial`."""

    @abstractmethod
    def energy_density(self, bar: MaterialLaw, axial: Array) -> Array:
        """Return the strain energy per reference volume [J/m^3], same shape as `axial`."""

    def limit(self, bar: MaterialLaw) -> tuple[float, float]:
        """Return (greatest nominal stress [Pa] on the rising branch, its stretch)."""
        return math.inf, math.inf

    def coefficients(self, bar: MaterialLaw) -> tuple[float, ...]:
        """Return what the solid's kernel takes beside G, lambda and K [Pa]."""
        return ()


class _Linear(Law):
    """P = E (l - 1), t = 1 - nu (l - 1); the tensile test that gave E."""

    def lateral_stretch(self, bar: MaterialLaw, axial: Array) -> Array:
        return 1.0 - bar.poisson * (axial - 1.0)

    def nominal_stress(self, bar: MaterialLaw, axial: Array) -> Array:
        return bar.young * (axial - 1.0)

    def energy_density(self, bar: MaterialLaw, axial: Array) -> Array:
        return np.asarray(0.5 * bar.young * (axial - 1.0) ** 2)


class _Hencky(Law):
    """Kirchhoff stress linear in the logarithmic strain, P = E ln(l) / l, t = l^-nu."""

    def lateral_stretch(self, bar: MaterialLaw, axial: Array) -> Array:
        return np.power(axial, -bar.poisson)

    def nominal_stress(self, bar: MaterialLaw, axial: Array) -> Array:
        return bar.young * np.log(axial) / axial

    def energy_density(self, bar: MaterialLaw, axial: Array) -> Array:
        return np.asarray(0.5 * bar.young * np.log(axial) ** 2)

    def limit(self, bar: MaterialLaw) -> tuple[float, float]:
        return bar.young / math.e, math.e


class _HenckyCauchy(_Hencky):
    """Cauchy stress linear in the logarithmic strain, P = E ln(l) l^(-2 nu), t = l^-nu."""

    def nominal_stress(self, bar: MaterialLaw, axial: Array) -> Array:
        return bar.young * np.log(axial) * np.power(axial, -2.0 * bar.poisson)

    def energy_density(self, bar: MaterialLaw, axial: Array) -> Array:
        power = 1.0 - 2.0 * bar.poisson
        if power == 0.0:
            return super().energy_density(bar, axial)
        log = np.log(axial)
        return np.asarray(bar.young * (axial**power * (log / power - power**-2) + power**-2))

    def limit(self, bar: MaterialLaw) -> tuple[float, float]:
        power = 2.0 * bar.poisson
        if power == 0.0:
            return math.inf, math.inf
        return bar.young / (power * math.e), math.exp(1.0 / power)


class _Hyperelastic(Law):
    """W = U(I1bar, I2bar) + (J - 1)^2 / D1, D1 = 2 / K; t from zero lateral stress.

    Incompressible: t = l^-1/2, P = 2 (l - l^-2)(dU/dI1bar + dU/dI2bar / l).
    """

    hyperelastic = True

    @abstractmethod
    def slopes(self, bar: MaterialLaw, axial: Array, side: Array) -> tuple[Values, Values]:
        """Return (dU/dI1bar, dU/dI2bar) [Pa] at axial and lateral stretches of one shape."""

    @abstractmethod
    def distortion(self, bar: MaterialLaw, i1: Array, i2: Array) -> Array:
        """Return U [J/m^3] at I1bar and I2bar of one shape."""

    def lateral_stretch(self, bar: MaterialLaw, axial: Array) -> Array:
        if bar.incompressible:
            return np.power(axial, -0.5)
        return self._free_side(bar, axial)

    def nominal_stress(self, bar: MaterialLaw, axial: Array) -> Array:
        if bar.incompressible:
            first, second = self.slopes(bar, axial, np.power(axial, -0.5))
            return np.asarray(2.0 * (axial - axial**-2) * (first + second / axial))
        side = self._free_side(bar, axial)
        first, second = self.slopes(bar, axial, side)
        volume = axial * side**2
        deviation = 4.0 / (3.0 * axial) * (axial**2 - side**2)
        return np.asarray(
            deviation * (first * volume ** (-2.0 / 3.0) + second * side**2 * volume ** (-4.0 / 3.0))
            + bar.bulk_modulus * (volume - 1.0) * side**2
        )

    def energy_density(self, bar: MaterialLaw, axial: Array) -> Array:
        side = self.lateral_stretch(bar, axial)
        volume = axial * side**2
        i1 = volume ** (-2.0 / 3.0) * (axial**2 + 2.0 * side**2)
        i2 = volume ** (-4.0 / 3.0) * (side**4 + 2.0 * axial**2 * side**2)
        energy = self.distortion(bar, i1, i2)
        if not bar.incompressible:
            energy = energy + 0.5 * bar.bulk_modulus * (volume - 1.0) ** 2
        return np.asarray(energy, dtype=float)

    def _free_side(self, bar: MaterialLaw, axial: Array) -> Array:
        bulk = bar.bulk_modulus

        def lateral_stress(side: Array) -> Array:
            first, second = self.slopes(bar, axial, side)
            volume = axial * side**2
            deviation = 4.0 / 3.0 * (side**2 - axial**2)
            return np.asarray(
                deviation
                * (first * volume ** (-2.0 / 3.0) / side + second * side * volume ** (-4.0 / 3.0))
                + 2.0 * bulk * (volume - 1.0) * axial * side
            )

        low, high = 0.3 * axial**-0.5, 3.0 * axial**-0.5
        for _ in range(60):
            middle = 0.5 * (low + high)
            below = lateral_stress(middle) < 0.0
            low = np.where(below, middle, low)
            high = np.where(below, high, middle)
        return np.asarray(0.5 * (low + high))


class _MooneyRivlin(_Hyperelastic):
    """U = C10 (I1bar - 3) + C01 (I2bar - 3), C10 + C01 = G / 2, C01 / C10 its own parameter."""

    def coefficients(self, bar: MaterialLaw) -> tuple[float, ...]:
        half = 0.5 * bar.shear_modulus
        c10 = half / (1.0 + bar.mooney_ratio)
        return c10, half - c10

    def slopes(self, bar: MaterialLaw, axial: Array, side: Array) -> tuple[Values, Values]:
        c10, c01 = self.coefficients(bar)
        return c10, c01

    def distortion(self, bar: MaterialLaw, i1: Array, i2: Array) -> Array:
        c10, c01 = self.coefficients(bar)
        return c10 * (i1 - 3.0) + c01 * (i2 - 3.0)


class _NeoHookean(_MooneyRivlin):
    """Mooney-Rivlin with C01 = 0."""

    def coefficients(self, bar: MaterialLaw) -> tuple[float, ...]:
        return 0.5 * bar.shear_modulus, 0.0


_LAWS: dict[str, Law] = {
    "linear": _Linear(),
    "hencky": _Hencky(),
    "hencky_cauchy": _HenckyCauchy(),
    "neo_hookean": _NeoHookean(),
    "mooney_rivlin": _MooneyRivlin(),
}
LAWS = tuple(_LAWS)


@dataclass(frozen=True, kw_only=True)
class LawParameters:
    """The choice of a law, and what laws have of their own.

    A law's own parameters are declared here and nowhere else: options, parameters of nodes, forms,
    tables and every model take them from this record. They are ratios, so that the stress of every
    law is proportional to Young's modulus.
    """

    law: str = parameter("linear", "material law", choices=LAWS, unit=PLAIN)
    mooney_ratio: float = parameter(
        0.25,
        "ratio C01 / C10 of law mooney_rivlin",
        PLAIN,
        0.0,
        100.0,
        label="Mooney ratio C01 / C10",
    )

    def law_values(self) -> dict[str, Any]:
        """Return these parameters by field, for another record that has them."""
        return {item.name: getattr(self, item.name) for item in dataclasses.fields(LawParameters)}

    def material_law(self, young: float, poisson: float) -> MaterialLaw:
        """Return the law with moduli, E [Pa] and nu."""
        return MaterialLaw(**self.law_values(), young=young, poisson=poisson)


@dataclass(frozen=True, kw_only=True)
class MaterialLaw(LawParameters):
    """A bar of unit reference section, pulled along its axis, free at its sides."""

    young: float = Material.young  # E [Pa]
    poisson: float = Material.poisson  # nu; 0.5 only with `incompressible`
    incompressible: bool = False  # Hold the volume exactly (hyperelastic laws)

    def __post_init__(self) -> None:
        if self.law not in _LAWS:
            raise ValueError(f"law must be one of {', '.join(LAWS)}, got {self.law!r}")
        if not (math.isfinite(self.young) and self.young > 0.0):
            raise ValueError(f"young must be positive, got {self.young} Pa")
        if not 0.0 <= self.poisson <= 0.5:
            raise ValueError(f"poisson must lie in [0, 0.5], got {self.poisson}")
        hyperelastic = _LAWS[self.law].hyperelastic
        if self.poisson == 0.5 and not self.incompressible and hyperelastic:
            raise ValueError("poisson 0.5 needs incompressible=True")
        if self.incompressible and not hyperelastic:
            those = " and ".join(name for name, law in _LAWS.items() if law.hyperelastic)
            raise ValueError(f"incompressible applies to {those}, not {self.law}")

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def bulk_modulus(self) -> float:
        """K = E / (3 (1 - 2 nu)) [Pa]."""
        return self.young / (3.0 * (1.0 - 2.0 * self.poisson))

    @property
    def coefficients(self) -> tuple[float, ...]:
        """What the law has beside G, lambda and K [Pa], see `Law.coefficients`."""
        return _LAWS[self.law].coefficients(self)

    def lateral_stretch(self, stretch: ArrayLike) -> Array:
        """Return the lateral stretch of free sides, same shape as `stretch`."""
        return _LAWS[self.law].lateral_stretch(self, _positive_stretch(stretch))

    def nominal_stress(self, stretch: ArrayLike) -> Array:
        """Return force over reference area [Pa], same shape as `stretch`."""
        return _LAWS[self.law].nominal_stress(self, _positive_stretch(stretch))

    def energy_density(self, stretch: ArrayLike) -> Array:
        """Return the strain energy per reference volume [J/m^3], same shape as `stretch`."""
        return _LAWS[self.law].energy_density(self, _positive_stretch(stretch))

    def limit(self) -> tuple[float, float]:
        """Return (greatest nominal stress [Pa] on the rising branch, its stretch).

        Infinite for laws that never fall.
        """
        return _LAWS[self.law].limit(self)

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

    def table(self) -> Array:
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


def _positive_stretch(stretch: ArrayLike) -> Array:
    axial = np.asarray(stretch, dtype=float)
    if not np.all(axial > 0.0):
        raise ValueError(f"stretch must be positive, got {float(np.min(axial))}")
    return axial
