"""The paper's tables: what was wound in its twelve cases, and what came out."""

import csv
import math
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files

from winding_core.cable.prony import PronySeries
from winding_core.units import MEGAPASCAL, MILLIMETRE


@dataclass(frozen=True, kw_only=True)
class Material:
    """Measured properties of the cable's material (paper, section 2: silicone rubber)."""

    young: float = 2.6e6  # Young's modulus E [Pa].
    poisson: float = 0.47  # Poisson's ratio.
    density: float = 1337.0  # Mass density [kg/m^3].
    axial_factor: float = 1.0  # Factor on the axial stiffness EA of the round section.
    bending_factor: float = 1.0  # Factor on its bending stiffness EI.
    # Strain of the outer fibre from which it must not be bent further; 0: not known.
    bending_limit: float = 0.0
    # Stress at which the outer fibre yields instead of bending further elastically [Pa]; 0: never.
    yield_stress: float = 0.0
    # How the axial stress fades; `young` is the modulus at once.
    prony: PronySeries = field(default_factory=PronySeries)

    def __post_init__(self) -> None:
        _positive("young", self.young, "Pa")
        _positive("density", self.density, "kg/m^3")
        _positive("axial_factor", self.axial_factor)
        _positive("bending_factor", self.bending_factor)
        if not 0.0 <= self.poisson < 0.5:
            raise ValueError(f"poisson must lie in [0, 0.5), got {self.poisson}")
        for name in ("bending_limit", "yield_stress"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must not be negative, got {value}")

    def refuse_fading(self, who: str) -> None:
        """Refuse a Prony series where none is known.

        Args:
            who: What knows elastic cables alone, as the sentence begins.

        Raises:
            ValueError: There is a series.
        """
        if self.prony.shares:
            raise ValueError(f"{who} knows elastic cables alone: leave out prony")


@dataclass(frozen=True, kw_only=True)
class Case:
    """One winding condition."""

    number: int = 0  # Row of Table 1, or 0 for any other condition.
    cylinder_diameter: float  # [m]
    cable_diameter: float  # Undeformed [m]
    weight: float  # Force of the dead weight on the cable's end [N].
    marker_spacing: float  # Distance of neighbouring markers along the undeformed cable [m].
    marker_count: int = 4  # Markers after P0.
    material: Material = field(default_factory=Material)  # The cable's material.

    def __post_init__(self) -> None:
        _positive("cylinder_diameter", self.cylinder_diameter, "m")
        _positive("cable_diameter", self.cable_diameter, "m")
        _positive("weight", self.weight, "N")
        _positive("marker_spacing", self.marker_spacing, "m")
        if self.marker_count < 1:
            raise ValueError(f"marker_count must be at least 1, got {self.marker_count}")
        limit = self.material.yield_stress
        if limit and not self.nominal_stress < limit:
            raise ValueError(
                f"the tension of {self.weight:g} N is {self.nominal_stress / MEGAPASCAL:.4g} MPa "
                f"of the section: it draws cable out that yields at {limit / MEGAPASCAL:.4g} MPa"
            )

    @property
    def is_published(self) -> bool:
        """Whether cable, cylinder, weight and markers are those of a row of Table 1."""
        return self.number > 0 and self == paper_case(self.number)

    @property
    def cylinder_radius(self) -> float:
        """R [m]."""
        return 0.5 * self.cylinder_diameter

    @property
    def cable_radius(self) -> float:
        """Undeformed r [m]."""
        return 0.5 * self.cable_diameter

    @property
    def centreline_radius(self) -> float:
        """R + r [m], undeformed: the radius behind every S_n."""
        return self.cylinder_radius + self.cable_radius

    @property
    def section_area(self) -> float:
        """Undeformed cross-section of the cable [m^2]."""
        return math.pi * self.cable_radius**2

    @property
    def axial_area(self) -> float:
        """Area that carries tension [m^2]: E times it is EA, with the material's factor."""
        return self.material.axial_factor * self.section_area

    @property
    def bending_stiffness(self) -> float:
        """EI of the undeformed section [N m^2], with the material's factor.

        Of cable that yields: what takes as much work as bending it to the cylinder does.
        """
        own = self.material.young * math.pi * self.cable_radius**4 / 4.0
        return self.material.bending_factor * own * yielding_share(self.elastic_core)

    @property
    def elastic_core(self) -> float:
        """Share of the radius within which cable bent to the cylinder stays elastic, at most 1."""
        limit = self.material.yield_stress
        strain = self.material.young * self.cable_radius / self.centreline_radius
        return min(limit / strain, 1.0) if limit else 1.0

    @property
    def nominal_stress(self) -> float:
        """Weight over undeformed section [Pa], the tension that Table 1 prints in MPa."""
        return self.weight / self.section_area

    @property
    def expected_stretch(self) -> float:
        """Stretch under the weight by the modulus alone: a first guess."""
        return 1.0 + self.nominal_stress / (self.material.young * self.material.axial_factor)

    def original_length(self, marker: int) -> float:
        """Return the undeformed cable length [m] from P0 to a marker."""
        return marker * self.marker_spacing


def yielding_share(core: float) -> float:
    """Return the work of bending a round bar over that of one that does not yield.

    Args:
        core: Share of the radius within which the stress has not reached a constant yield stress,
            in (0, 1].
    """
    left = 1.0 - core**2
    angle, root = math.asin(core), math.sqrt(left)
    elastic = 0.25 * (angle - core * (1.0 - 2.0 * core**2) * root)
    plastic = 4.0 / 3.0 * core * left * root
    ring = math.pi - 2.0 * (angle + core * root)
    return 8.0 / math.pi * (elastic + plastic - 0.5 * core**2 * ring)


def paper_case(number: int) -> Case:
    """Return one of the twelve cases of Table 1.

    Raises:
        ValueError: The number is not in 1..12.
    """
    conditions = published_conditions()
    if number not in conditions:
        raise ValueError(f"case must be one of 1 to {len(conditions)}, got {number}")
    return conditions[number]


def paper_cases() -> tuple[Case, ...]:
    """Return the twelve cases of Table 1 in order."""
    return tuple(published_conditions().values())


def _positive(name: str, value: float, unit: str = "") -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive and finite, got {value} {unit}".rstrip())


@dataclass(frozen=True, kw_only=True)
class Lay:
    """Where a marker lies: wound angle theta [rad], axial position z [m], curve length s [m]."""

    theta: float
    z: float
    s: float


@dataclass(frozen=True, kw_only=True)
class PublishedMarker:
    """One marker of one case: Tables 2-4 (theta, z), 5-6 (S), 7 and 8 (errors in percent)."""

    case: int  # 1 to 12.
    marker: int  # n of Pn.
    original_length: float  # From P0 along the undeformed cable [m].
    simulation: Lay  # The paper's finite elements.
    # The measurement; None, like both errors, where the paper prints a dash.
    experiment: Lay | None
    error_pct: float | None  # Table 7 [%].
    updated_error_pct: float | None  # Table 8 [%].


@cache
def published_conditions() -> dict[int, Case]:
    """Return Table 1 by case number."""
    return {
        int(row["case"]): Case(
            number=int(row["case"]),
            cylinder_diameter=float(row["cylinder_diameter_mm"]) * MILLIMETRE,
            cable_diameter=float(row["cable_diameter_mm"]) * MILLIMETRE,
            weight=float(row["weight_n"]),
            marker_spacing=float(row["marker_spacing_mm"]) * MILLIMETRE,
        )
        for row in _rows("cases.csv")
    }


@cache
def published_markers(case: int | None = None) -> tuple[PublishedMarker, ...]:
    """Return the markers of one case in order, or all 48."""
    markers = tuple(_marker(row) for row in _rows("markers.csv"))
    return markers if case is None else tuple(m for m in markers if m.case == case)


@cache
def published_weights() -> dict[int, float]:
    """Return the weight h by case: the twelve numbers that reproduce Table 8 to its last digit."""
    return {int(row["case"]): float(row["h"]) for row in _rows("recovered_weights.csv")}


def length_error_pct(measured: float, predicted: float) -> float:
    """Return Table 7's error: 100 |S_EXP - S_FEM| / S_FEM.

    Table 8 is the same measure of the corrected prediction h S_FEM.

    Raises:
        ValueError: The predicted length [m] is not positive.
    """
    if not predicted > 0.0:
        raise ValueError(f"predicted length must be positive, got {predicted} m")
    return 100.0 * abs(measured - predicted) / predicted


def _rows(name: str) -> list[dict[str, str]]:
    text = files("winding_core").joinpath("data", name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


def _marker(row: dict[str, str]) -> PublishedMarker:
    return PublishedMarker(
        case=int(row["case"]),
        marker=int(row["marker"]),
        original_length=float(row["original_length_mm"]) * MILLIMETRE,
        simulation=_lay(row, "sim"),
        experiment=_lay(row, "exp") if row["exp_theta_rad"] else None,
        error_pct=_number(row["error_pct"]),
        updated_error_pct=_number(row["updated_error_pct"]),
    )


def _lay(row: dict[str, str], column: str) -> Lay:
    return Lay(
        theta=float(row[f"{column}_theta_rad"]),
        z=float(row[f"{column}_z_mm"]) * MILLIMETRE,
        s=float(row[f"{column}_length_mm"]) * MILLIMETRE,
    )


def _number(text: str) -> float | None:
    return float(text) if text else None
