"""How wrong a corrected length may be: conformal bounds from cases that were left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from correction_node.models.dataset import Array, LengthCell, case_numbers, lengths, turns
from winding_core.cable.cases import Case, Material

LEVEL = 0.9
ROUNDING = 1.0e-3  # Table 1 prints four digits; the weights behind it differ by up to 0.03 %


@dataclass(frozen=True, kw_only=True)
class Bound:
    """Relative half-width of the interval around h S_FEM."""

    relative: float  # |S / (h S_FEM) - 1| of every marker of a new case stays below it ..
    level: float  # ... with this probability, if new cases are drawn like the known ones


def conformal_bound(cells: Sequence[LengthCell], held_out: Array, level: float = LEVEL) -> Bound:
    """Return the jackknife bound over whole cases.

    The score of a case is the largest relative residual of its markers, from the model that
    left it out, because the markers of one cable are not independent. Of n exchangeable scores
    the ceil((n + 1) level)-th smallest covers the next one with probability `level`. Twelve
    cases carry at most 12/13 = 92.3 %, and 90 % already asks for the largest residual of all.
    It stays a statement about cases like these twelve, which are a designed grid and not a
    random draw, and about a final model that saw all of them.

    Args:
        cells: The measured cells.
        held_out: h of each cell from a model that never saw its case, shape (n,).
        level: Wanted probability.

    Raises:
        ValueError: There are too few cases for the level.
    """
    s_fem, s_exp = lengths(cells)
    residual = np.abs(s_exp / (held_out * s_fem) - 1.0)
    cases = case_numbers(cells)
    scores = np.sort([residual[cases == case].max() for case in np.unique(cases)])
    rank = math.ceil((len(scores) + 1) * level)
    if not 0.0 < level < 1.0 or rank > len(scores):
        raise ValueError(
            f"level must lie in (0, {len(scores) / (len(scores) + 1):.3f}] with "
            f"{len(scores)} cases, got {level}"
        )
    return Bound(relative=float(scores[rank - 1]), level=rank / (len(scores) + 1))


@dataclass(frozen=True, kw_only=True)
class TrainingBox:
    """The conditions between those that were trained on.

    Tension is taken as a force: the trained weights hang on cables of every diameter, so in
    (D_cylinder, D_cable, force) the training conditions fill a box, while a box in nominal stress
    would include thirty newtons on the thickest cable.
    """

    cylinder_diameter: tuple[float, float]  # (smallest, largest) [m]
    cable_diameter: tuple[float, float]  # (smallest, largest) [m]
    weight: tuple[float, float]  # (smallest, largest) [N]
    # Most turns of unstretched cable before a marker; None when h does not depend on the marker.
    # Below the first trained marker h stays what it is there.
    turns: float | None = None
    young: tuple[float, float] = (Material().young,) * 2  # As configured in the solver [Pa]
    # Diameter [m] and modulus [Pa] of each cable, where no other one is inside; else empty.
    cables: tuple[tuple[float, float], ...] = ()

    @classmethod
    def around(cls, cells: Sequence[LengthCell], *, by_marker: bool = False) -> TrainingBox:
        """Return the smallest box that holds the cells' conditions."""
        weights = [0.25 * math.pi * c.cable_diameter**2 * c.tension for c in cells]
        return cls(
            cylinder_diameter=_range([c.cylinder_diameter for c in cells]),
            cable_diameter=_range([c.cable_diameter for c in cells]),
            weight=_range(weights),
            turns=max(turns(c) for c in cells) if by_marker else None,
            young=_range([c.young for c in cells]),
        )

    def outside(self, case: Case) -> str | None:
        """Return one sentence on why a condition lies outside, or None when it lies inside."""
        one_young = self.young[0] == self.young[1]
        own = (case.cable_diameter, case.material.young)
        if self.cables and not np.isclose(own, self.cables, rtol=ROUNDING).all(axis=1).any():
            known = ", ".join(_cable(cable) for cable in self.cables)
            return f"the cable, {_cable(own)}, is none of the trained {known}: no correction"
        for name, value, (low, high), unit in (
            ("cylinder_diameter", case.cylinder_diameter, self.cylinder_diameter, "m"),
            ("cable_diameter", case.cable_diameter, self.cable_diameter, "m"),
            ("weight", case.weight, self.weight, "N"),
            *([] if one_young else [("young", case.material.young, self.young, "Pa")]),
        ):
            if not low * (1.0 - ROUNDING) <= value <= high * (1.0 + ROUNDING):
                return (
                    f"{name} {value:.4g} {unit} lies outside the trained range "
                    f"{low:.4g} to {high:.4g} {unit}: no correction"
                )
        trained = Material(young=self.young[0] if one_young else case.material.young)
        for item in fields(trained):
            value, known = (getattr(one, item.name) for one in (case.material, trained))
            if value != known:
                return f"{item.name} {value:.4g} is not the trained {known:.4g}: no correction"
        wound = case.original_length(case.marker_count) / (math.pi * case.cylinder_diameter)
        if self.turns is not None and wound > self.turns * (1.0 + ROUNDING):
            return (
                f"marker {case.marker_count} lies {wound:.4g} turns from P0, beyond the trained "
                f"{self.turns:.4g}: no correction"
            )
        return None


def _cable(cable: tuple[float, float]) -> str:
    return f"{cable[0]:.4g} m with {cable[1]:.4g} Pa"


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)
