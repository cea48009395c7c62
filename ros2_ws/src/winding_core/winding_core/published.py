"""Reader of the paper's tables; the only place where millimetres and megapascals enter."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from winding_core.units import MEGAPASCAL, MILLIMETRE


@dataclass(frozen=True, kw_only=True)
class PublishedCondition:
    """One row of Table 1, in SI.

    Attributes:
        case: 1 to 12.
        cylinder_diameter: [m].
        cable_diameter: [m].
        nominal_stress: Weight over the undeformed section [Pa].
        weight: [N].
        marker_spacing: Along the undeformed cable [m].
    """

    case: int
    cylinder_diameter: float
    cable_diameter: float
    nominal_stress: float
    weight: float
    marker_spacing: float


@dataclass(frozen=True, kw_only=True)
class Lay:
    """Where a marker lies: wound angle theta [rad], axial position z [m], curve length s [m]."""

    theta: float
    z: float
    s: float


@dataclass(frozen=True, kw_only=True)
class PublishedMarker:
    """One marker of one case: Tables 2-4 (theta, z), 5-6 (S), 7 and 8 (errors in percent).

    Attributes:
        case: 1 to 12.
        marker: n of Pn.
        original_length: From P0 along the undeformed cable [m].
        simulation: The paper's finite elements.
        experiment: The measurement; None, like both errors, where the paper prints a dash.
        error_pct: Table 7 [%].
        updated_error_pct: Table 8 [%].
    """

    case: int
    marker: int
    original_length: float
    simulation: Lay
    experiment: Lay | None
    error_pct: float | None
    updated_error_pct: float | None


@cache
def published_conditions() -> dict[int, PublishedCondition]:
    """Return Table 1 by case number."""
    return {
        int(row["case"]): PublishedCondition(
            case=int(row["case"]),
            cylinder_diameter=float(row["cylinder_diameter_mm"]) * MILLIMETRE,
            cable_diameter=float(row["cable_diameter_mm"]) * MILLIMETRE,
            nominal_stress=float(row["tension_mpa"]) * MEGAPASCAL,
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
