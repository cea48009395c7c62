"""What was identified of a material or a rig: as records for JSON, and as tables of these."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from cable_fem_node.identification import Fit, ModulusEstimate, RigPosterior, TrackedRun
from cable_fem_node.identification.rig_posterior import Belief
from winding_cli.terminal.console import Shown, marker_name, record_table
from winding_core.helix import curve_length
from winding_core.markers import Markers, is_wound
from winding_core.units import MEGAPASCAL, MILLIMETRE, MILLIRADIAN, json_values
from winding_study.identification.constants import ConstantsEstimate

_RUN = Shown("run", lambda row: row["run"] + 1)
_MARKER = Shown("marker", marker_name)
_RESIDUALS = (
    _RUN,
    _MARKER,
    Shown("theta, rad", "theta", ".4f"),
    Shown("fitted", "theta_fitted", ".4f"),
    Shown("misses by, mrad", lambda row: row["theta_fitted"] - row["theta"], ".1f", MILLIRADIAN),
    Shown("z by, mm", lambda row: row["z_fitted"] - row["z"], ".2f", MILLIMETRE),
)
_PLACE = (
    Shown("theta, rad", "theta_rad", ".3f"),
    Shown("z, mm", "z_m", ".2f", MILLIMETRE),
    Shown("S, mm", "s_m", ".2f", MILLIMETRE),
)
_MEASURED = (
    Shown("measured S, mm", "s_measured_m", ".2f", MILLIMETRE),
    Shown("error, %", "error_pct", ".2f"),
)
_WITHIN = Shown("within, mm", "half_width_90_m", ".2f", MILLIMETRE)


def _scaled(heading: str, key: str, digits: str = ".4g") -> Shown:
    return Shown(heading, lambda belief: getattr(belief, key) / belief.unit, digits)


_BELIEFS = (
    Shown("", lambda belief: belief.words),
    _scaled("mean", "mean"),
    _scaled("deviation", "deviation", ".2g"),
    _scaled("low", "low"),
    _scaled("high", "high"),
    _scaled("before, low", "prior_low"),
    _scaled("high", "prior_high"),
    Shown("identified by the markers", lambda belief: "yes" if belief.observed else "no"),
)
# What `rig_record` has of each number.
_RECORDED = ("mean", "deviation", "low", "high", "prior_deviation", "half_width_90", "observed")


def print_modulus(console: Console, estimate: ModulusEstimate) -> dict[str, Any]:
    """Print a modulus with its errors; return it for JSON, in Pa."""
    console.print(
        f"law {estimate.law}: effective Young's modulus {estimate.young / MEGAPASCAL:.4g} MPa, "
        f"standard error {estimate.standard_error / MEGAPASCAL:.2g} MPa; nine times in ten within "
        f"{estimate.half_width_90 / MEGAPASCAL:.2g} MPa "
        f"({estimate.half_width_90 / estimate.young:.1%})"
    )
    return json_values(estimate, "law", "young_pa", "standard_error_pa", "half_width_90_pa")


def print_constants(console: Console, found: ConstantsEstimate) -> dict[str, Any]:
    """Print the constants of a nonlinear law; return them for JSON, in Pa."""
    errors = found.standard_errors
    console.print(
        f"law {found.law}: C10 {found.c10 / MEGAPASCAL:.4g} MPa (standard error "
        f"{errors[0] / MEGAPASCAL:.2g}), C01 {found.c01 / MEGAPASCAL:.4g} MPa (standard error "
        f"{errors[1] / MEGAPASCAL:.2g}), initial modulus {found.young / MEGAPASCAL:.4g} MPa "
        f"(standard error {found.young_standard_error / MEGAPASCAL:.2g})\n{found.statement()}"
    )
    return {
        **json_values(found, "law", "c10_pa", "c01_pa", "young_pa", "separable"),
        "c10_standard_error_pa": errors[0],
        "c01_standard_error_pa": errors[1],
        "standard_error_pa": found.young_standard_error,
        "statement": found.statement(),
    }


def print_fit(console: Console, fit: Fit) -> dict[str, Any]:
    """Print where the used markers lie, measured and fitted; return it for JSON, SI."""
    residuals = [dataclasses.asdict(row) for row in fit.residuals]
    console.print(record_table(_RESIDUALS, residuals, title="Markers that were used"))
    if fit.degrees == 0:
        console.print("one marker for one number: the fit cannot be judged by its residuals")
    elif fit.misfit:
        console.print(
            "the residuals are larger than tracker and model explain: each angle scatters by "
            f"{fit.scatter:.2%} more, this cable is not of one modulus, and the errors say so"
        )
    return {
        "residuals": residuals,
        **json_values(fit, "chi_square", "misfit", "scatter"),
        "degrees_of_freedom": fit.degrees,
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
    measured, taken = _measured(run), set(used.readings.ids.tolist())
    record = [
        {
            "run": number,
            "id": int(row["id"]),
            "theta_rad": float(row["theta"]),
            "z_m": float(row["z"]),
            "s_m": float(row["s"]),
            **_beside(measured.get(int(row["id"])), float(row["s"])),
        }
        for row in predicted[1:][is_wound(predicted)[1:]]
        if int(row["id"]) not in taken
    ]
    title = f"Remaining markers of run {number + 1}, with the identified material"
    if record:
        console.print(record_table((_MARKER, *_PLACE, *_MEASURED), record, title=title))
    return record


def _measured(run: TrackedRun) -> dict[int, float]:
    """Return the measured curve length [m] of every marker of a run."""
    readings = run.readings
    radius = run.config.case.centreline_radius
    lengths = curve_length(radius, readings.theta, readings.z).tolist()
    return dict(zip(readings.ids.tolist(), lengths, strict=True))


def _beside(measured: float | None, s: float) -> dict[str, float | None]:
    """Return a measured length [m] beside a predicted one, and the error between them."""
    error = None if measured is None else 100.0 * abs(measured - s) / s
    return {"s_measured_m": measured, "error_pct": error}


def rig_record(posterior: RigPosterior, runs: Sequence[TrackedRun]) -> dict[str, Any]:
    """Return the posterior as JSON, SI units."""
    return {
        "rig": {
            name: json_values(belief, *_RECORDED) for name, belief in posterior.beliefs.items()
        },
        "names": list(posterior.names),
        "covariance": posterior.covariance.tolist(),
        "correlation": posterior.correlation.tolist(),
        "steady_probability": posterior.steady,
        "unobservable": list(posterior.unobservable),
        **json_values(posterior, "chi_square", "measured", "misfit", "scatter_m", "worst_share"),
        "predicted": list(_ahead(posterior, runs)),
        "refused": posterior.refusal(),
    }


def beliefs_table(beliefs: Sequence[Belief], title: str) -> Table:
    """Return a table of numbers before and after."""
    return record_table(_BELIEFS, beliefs, words=1, title=title)


def print_rig(console: Console, posterior: RigPosterior, record: dict[str, Any]) -> None:
    """Print a posterior and what `rig_record` returned of it."""
    title = "The rig; nine times in ten between low and high"
    console.print(beliefs_table(posterior.found, title))
    console.print(
        f"probability that the tension does not build up: {posterior.steady:.0%}; "
        f"sum of squares {posterior.chi_square:.3g} of {posterior.measured} numbers"
    )
    for sentence in posterior.remarks():
        console.print(sentence)
    if record["predicted"]:
        columns = (_RUN, _MARKER, *_PLACE, _WITHIN, *_MEASURED)
        console.print(record_table(columns, record["predicted"], title="Remaining markers"))


def _ahead(posterior: RigPosterior, runs: Sequence[TrackedRun]) -> Iterator[dict[str, Any]]:
    for number, (run, markers) in enumerate(zip(runs, posterior.ahead, strict=True)):
        measured = _measured(run)
        for marker in markers:
            yield {
                "run": number,
                **json_values(marker, "id", "theta_rad", "sigma_theta_rad", "z_m", "sigma_z_m"),
                **json_values(marker, "s_m", "half_width_90_m"),
                **_beside(measured.get(marker.id), marker.s),
            }
