"""What `winding identify` has to say of a fitted material: for people, and as JSON."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from rich.table import Table

from winding_core.helix import curve_length
from winding_core.markers import is_wound
from winding_core.units import MEGAPASCAL, MILLIMETRE, MILLIRADIAN

if TYPE_CHECKING:
    from rich.console import Console

    from cable_fem_node.identification import Fit, ModulusEstimate, TrackedRun
    from winding_core.markers import Markers
    from winding_study.identification.constants import ConstantsEstimate


def print_modulus(console: Console, estimate: ModulusEstimate) -> dict[str, Any]:
    """Print a modulus with its errors; return it for JSON, in Pa."""
    console.print(
        f"law {estimate.law}: effective Young's modulus {estimate.young / MEGAPASCAL:.4g} MPa, "
        f"standard error {estimate.standard_error / MEGAPASCAL:.2g} MPa; nine times in ten within "
        f"{estimate.half_width_90 / MEGAPASCAL:.2g} MPa "
        f"({estimate.half_width_90 / estimate.young:.1%})",
        highlight=False,
    )
    return {
        "law": estimate.law,
        "young_pa": estimate.young,
        "standard_error_pa": estimate.standard_error,
        "half_width_90_pa": estimate.half_width_90,
    }


def print_constants(console: Console, found: ConstantsEstimate) -> dict[str, Any]:
    """Print the constants of a nonlinear law; return them for JSON, in Pa."""
    errors = found.standard_errors
    console.print(
        f"law {found.law}: C10 {found.c10 / MEGAPASCAL:.4g} MPa (standard error "
        f"{errors[0] / MEGAPASCAL:.2g}), C01 {found.c01 / MEGAPASCAL:.4g} MPa (standard error "
        f"{errors[1] / MEGAPASCAL:.2g}), initial modulus {found.young / MEGAPASCAL:.4g} MPa "
        f"(standard error {found.young_standard_error / MEGAPASCAL:.2g})\n{found.statement()}",
        highlight=False,
    )
    return {
        "law": found.law,
        "c10_pa": found.c10,
        "c01_pa": found.c01,
        "c10_standard_error_pa": errors[0],
        "c01_standard_error_pa": errors[1],
        "young_pa": found.young,
        "standard_error_pa": found.young_standard_error,
        "separable": found.separable,
        "statement": found.statement(),
    }


def print_fit(console: Console, fit: Fit) -> dict[str, Any]:
    """Print where the used markers lie, measured and fitted; return it for JSON, SI."""
    table = Table(title="Markers that were used")
    for heading in ("run", "marker", "theta, rad", "fitted", "misses by, mrad", "z by, mm"):
        table.add_column(heading, justify="right")
    for row in fit.residuals:
        table.add_row(
            str(row.run + 1),
            f"P{row.id}",
            f"{row.theta:.4f}",
            f"{row.theta_fitted:.4f}",
            f"{(row.theta_fitted - row.theta) / MILLIRADIAN:.1f}",
            f"{(row.z_fitted - row.z) / MILLIMETRE:.2f}",
        )
    console.print(table)
    if fit.degrees == 0:
        console.print("one marker for one number: the fit cannot be judged by its residuals")
    elif fit.misfit:
        console.print(
            "the residuals are larger than tracker and model explain: each angle scatters by "
            f"{fit.scatter:.2%} more, this cable is not of one modulus, and the errors say so",
            highlight=False,
        )
    return {
        "residuals": [dataclasses.asdict(row) for row in fit.residuals],
        "chi_square": fit.chi_square,
        "degrees_of_freedom": fit.degrees,
        "misfit": fit.misfit,
        "scatter": fit.scatter,
        "rod_calls": fit.calls,
    }


def print_rest(
    console: Console, number: int, run: TrackedRun, used: TrackedRun, predicted: Markers
) -> list[dict[str, Any]]:
    """Print the markers of a run that were not used; return them for JSON, SI.

    Args:
        console: Where to.
        number: Of the run, from 0.
        run: With all markers that were measured.
        used: With those that were used.
        predicted: All markers as wound with what was identified.
    """
    radius = run.config.case.centreline_radius
    measured = {
        int(marker): float(curve_length(radius, theta, z))
        for marker, theta, z in zip(
            run.readings.ids, run.readings.theta.tolist(), run.readings.z.tolist(), strict=True
        )
    }
    taken = set(used.readings.ids.tolist())
    rows = [row for row in predicted[1:][is_wound(predicted)[1:]] if int(row["id"]) not in taken]
    table = Table(title=f"Remaining markers of run {number + 1}, with the identified material")
    for heading in ("marker", "theta, rad", "z, mm", "S, mm", "measured S, mm", "error, %"):
        table.add_column(heading, justify="right")
    record = []
    for row in rows:
        marker, s = int(row["id"]), float(row["s"])
        known = measured.get(marker)
        error = None if known is None else 100.0 * abs(known - s) / s
        table.add_row(
            f"P{marker}",
            f"{row['theta']:.3f}",
            f"{row['z'] / MILLIMETRE:.2f}",
            f"{s / MILLIMETRE:.2f}",
            "-" if known is None else f"{known / MILLIMETRE:.2f}",
            "-" if error is None else f"{error:.2f}",
        )
        record.append(
            {
                "run": number,
                "id": marker,
                "theta_rad": float(row["theta"]),
                "z_m": float(row["z"]),
                "s_m": s,
                "s_measured_m": known,
                "error_pct": error,
            }
        )
    if rows:
        console.print(table)
    return record
