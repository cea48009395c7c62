"""`winding identify`: the material of a cable, from its markers or from a tensile test."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from winding_cli.commands.condition_options import Typed, spelled, with_options
from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import check_output_file, write_json
from winding_cli.commands.refusal import FAILED, refuse, refused
from winding_core.units import KILOPASCAL, MEGAPASCAL, MILLIMETRE, MILLIRADIAN
from winding_study.runs.run_parameters import RunParameters

if TYPE_CHECKING:
    from cable_fem_node.identification import Fit, ModulusEstimate, TrackedRun
    from cable_fem_node.winding.winding_config import WindingConfig
    from winding_core.markers import Markers
    from winding_study.identification.constants import ConstantsEstimate


@with_options(RunParameters)
def identify(
    typed: Typed,
    *,
    sources: Annotated[
        list[Path] | None,
        typer.Argument(help="Recordings (folder, .mcap) or tables of markers (.csv) of one cable."),
    ] = None,
    tensile: Annotated[
        Path | None,
        typer.Option(help="CSV of a tensile test instead: strain, stress_mpa (nominal)."),
    ] = None,
    weight_n: Annotated[
        list[float] | None,
        typer.Option(help="Weight of each source in turn, in N; repeat it for each."),
    ] = None,
    use: Annotated[
        int | None, typer.Option(min=1, help="Identify from the first so many markers alone.")
    ] = None,
    rig: Annotated[
        bool,
        typer.Option(
            "--rig",
            help="Identify the rig with the material: free length, load share, drag, build-up.",
        ),
    ] = False,
    known_tension: Annotated[
        bool,
        typer.Option("--known-tension", help="With --rig: the stated tension is the span's own."),
    ] = False,
    fixing_mm: Annotated[
        float | None,
        typer.Option(help="With --rig: standard deviation of where P0 was fixed, in mm; else 0."),
    ] = None,
    scatter_mm: Annotated[
        float | None,
        typer.Option(help="With --rig: the same of every other marker's place, in mm; else 0."),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the result to this file.")
    ] = None,
) -> None:
    """Identify the cable's material from tracked markers by inverse winding, or from a test."""
    from cable_fem_node.identification import IdentificationError
    from winding_recorder.bags.failure import BagError
    from winding_study.identification.tables import SourceError

    if (tensile is None) == (not sources):
        refuse("give recordings or tables of markers, or --tensile with a stress-strain table")
    if rig and tensile is not None:
        refuse("--rig needs markers, --tensile has none")
    if not rig and (known_tension or fixing_mm is not None or scatter_mm is not None):
        refuse("--known-tension, --fixing-mm and --scatter-mm need --rig")
    check_output_file(json_file)
    with refused(IdentificationError, SourceError, BagError, ValueError):
        if tensile is not None:
            record = _tensile(tensile, RunParameters.from_typed(typed, case=RunParameters.case))
        else:
            runs = _runs(sources or [], weight_n or [], typed)
            if rig:
                record = _rig(runs, use, known_tension, fixing_mm or 0.0, scatter_mm or 0.0)
            else:
                record = _identified(runs, use)
    if json_file is not None:
        write_json(json_file, record)
    if record.get("refused"):
        refuse(record["refused"], FAILED)


def _runs(sources: list[Path], weights: list[float], typed: Typed) -> list[TrackedRun]:
    from winding_study.identification.tables import SourceError

    if weights and len(weights) != len(sources):
        raise SourceError(
            f"give --weight-n once for each of {len(sources)} sources, got {len(weights)}"
        )
    element = typed.get("element", RunParameters.element)
    if element != "rod":
        raise SourceError(f"identification winds the rod, not the element {element}")
    missing = [source for source in sources if not source.exists()]
    if missing:
        raise SourceError(f"{missing[0]} does not exist")
    own: list[Typed] = [typed] * len(sources)
    if weights:
        own = [{**typed, "tension_n": weight, "tension_mpa": None} for weight in weights]
    return [_run(source, each) for source, each in zip(sources, own, strict=True)]


def _run(source: Path, typed: Typed) -> TrackedRun:
    from cable_fem_node.identification import TrackedRun
    from winding_core.planned_inputs import planned_inputs
    from winding_recorder.bags.tables import topic_rows
    from winding_study.identification.recorded import recorded_run
    from winding_study.identification.tables import read_readings

    if source.is_dir() or source.suffix in (".mcap", ".db3"):
        return recorded_run(
            _recorded_config(source, typed),
            tracked=topic_rows(source, "tracker/markers"),
            joints=topic_rows(source, "rig/joint_states"),
            tension=topic_rows(source, "rig/tension"),
        )
    plan = RunParameters.from_typed(typed, spelling=spelled).plan()
    return TrackedRun(
        config=plan.config,
        inputs=planned_inputs(plan.drive, plan.duration),
        readings=read_readings(source),
    )


def _recorded_config(source: Path, typed: Typed) -> WindingConfig:
    """Return what was wound: what was typed of it, else what the solver's node was set to."""
    from cable_fem_node.ros.parameters import FemParameters
    from winding_recorder.bags.failure import BagError
    from winding_recorder.bags.recorded_parameters import configuration_of, recorded_parameters
    from winding_ros.topics import FEM

    if "case" in typed or "cylinder_diameter_mm" in typed:
        return RunParameters.from_typed(typed, spelling=spelled).plan().config
    try:
        stated = recorded_parameters(source, FEM)
    except BagError as error:
        raise BagError(f"{source} does not say what was wound: give --case") from error
    config = configuration_of(FemParameters, stated, FEM).winding_config()
    return dataclasses.replace(config, law=str(typed.get("law", RunParameters.law)))


def _first(runs: list[TrackedRun], use: int | None) -> list[TrackedRun]:
    """Return the runs with their first markers alone; None: with all."""
    if use is None:
        return runs
    return [dataclasses.replace(run, readings=run.readings.first(use)) for run in runs]


def _rig(
    runs: list[TrackedRun], use: int | None, known: bool, fixing_mm: float, scatter_mm: float
) -> dict[str, Any]:
    from cable_fem_node.identification import KNOWN_TENSION, RigPrior, identify_rig
    from winding_cli.output.rig_posterior import print_rig, rig_record

    prior = dataclasses.replace(
        KNOWN_TENSION if known else RigPrior(),
        fixing=fixing_mm * MILLIMETRE,
        scatter=scatter_mm * MILLIMETRE,
    )
    record = rig_record(identify_rig(_first(runs, use), prior), runs)
    print_rig(result_console(), record)
    return record


def _identified(runs: list[TrackedRun], use: int | None) -> dict[str, Any]:
    from cable_fem_node.identification import identify_modulus, with_young
    from winding_study.identification.constants import identify_constants

    used, law = _first(runs, use), runs[0].config.law
    console = result_console()
    if len(runs) > 1 and law in ("neo_hookean", "mooney_rivlin"):
        constants = identify_constants(used, law)
        record = _print_constants(console, constants)
        record["refused"] = ""
        fit, young, ratio = (
            constants.fit,
            constants.young,
            constants.share / (1.0 - constants.share),
        )
    else:
        estimate = identify_modulus(used)
        record = _print_modulus(console, estimate)
        record["refused"] = estimate.refusal()
        fit, young, ratio = estimate.fit, estimate.young, runs[0].config.mooney_ratio
    record |= _print_fit(console, fit)
    if not record["refused"]:
        record["predicted"] = []
        for number, (run, part) in enumerate(zip(runs, used, strict=True)):
            config = dataclasses.replace(with_young(run.config, young), mooney_ratio=ratio)
            predicted = _wound(run, config)
            record["predicted"] += _print_rest(console, number, run, part, predicted)
    return record


def _wound(run: TrackedRun, config: WindingConfig) -> Markers:
    from cable_fem_node.winding.replay import replay
    from cable_fem_node.winding.rod_winding import RodWinding

    model = RodWinding(config)
    replay(run.inputs, model)
    return model.markers()


def _print_modulus(console: Console, estimate: ModulusEstimate) -> dict[str, Any]:
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


def _print_constants(console: Console, found: ConstantsEstimate) -> dict[str, Any]:
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


def _print_fit(console: Console, fit: Fit) -> dict[str, Any]:
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


def _print_rest(
    console: Console, number: int, run: TrackedRun, used: TrackedRun, predicted: Markers
) -> list[dict[str, Any]]:
    from winding_core.helix import curve_length
    from winding_core.markers import is_wound

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


def _tensile(path: Path, parameters: RunParameters) -> dict[str, Any]:
    from winding_study.documents.data_table import known
    from winding_study.identification.tables import read_tensile_test
    from winding_study.identification.tensile import fit_laws, judgement

    poisson = parameters.poisson
    fits = fit_laws(read_tensile_test(path), poisson)
    console = result_console()
    table = Table(title=f"Laws of {path.name}, best first")
    for heading in ("law", "E, MPa", "standard error", "C01 share", "rms, kPa", "AICc"):
        table.add_column(heading, justify="right")
    for item in fits:
        table.add_row(
            item.law,
            f"{item.young / MEGAPASCAL:.4g}",
            f"{item.young_standard_error / MEGAPASCAL:.2g}",
            f"{item.share:.2f} +- {item.share_standard_error:.2f}"
            if item.law == "mooney_rivlin"
            else "-",
            f"{item.rms / KILOPASCAL:.3g}",
            f"{item.aicc:.1f}",
        )
    console.print(table)
    console.print(judgement(fits), highlight=False)
    laws = [
        {name: known(value) for name, value in dataclasses.asdict(item).items()} for item in fits
    ]
    return {"poisson": poisson, "judgement": judgement(fits), "laws": laws}
