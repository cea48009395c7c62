"""`winding predict`: wind a run ahead of time, without ROS."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import TaskProgressColumn

from cable_fem_node.dynamics.state import FloatArray, SolverError
from cable_fem_node.winding.discretisation import discretisation_error
from cable_fem_node.winding.expected_cost import ExpectedCost, expected_cost
from cable_fem_node.winding.prediction import Look, PlannedRun, Prediction
from winding_cli.offline.wound_parameters import wound_parameters
from winding_cli.terminal.console import Shown, busy, marker_name, record_table, result_console
from winding_cli.terminal.output_path import (
    Force,
    Json,
    by_suffix,
    check_output_file,
    check_output_folder,
    staged,
    write_json,
)
from winding_cli.terminal.record_options import Cable, Library, Typed, spelled, with_options
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_core.units import MILLIMETRE, MILLIRADIAN, json_values, known
from winding_study.run_parameters import RunParameters

_FEW_STEPS = 1.0e6  # A run of so few steps takes seconds, and is not timed beforehand
_LONG_S = 5.0  # Processor time that is announced [s]

_MARKERS = (
    Shown("marker", marker_name),
    Shown("theta, rad", "theta_rad", ".3f"),
    Shown("z, mm", "z_m", ".2f", MILLIMETRE),
    Shown("S, mm", "s_m", ".2f", MILLIMETRE),
    Shown("on the cylinder", lambda marker: "yes" if marker["wound"] else "no"),
)
_TURNS = (
    Shown("turn", lambda turn: turn[0]),
    Shown("cable used, mm", lambda turn: turn[1], ".2f", MILLIMETRE),
    Shown("advance, mm", lambda turn: turn[2], ".2f", MILLIMETRE),
    Shown("lies", lambda turn: turn[3]),
)
_ERRORS = (
    Shown("marker", lambda error: f"P{error[0]}"),
    Shown("theta, mrad", lambda error: error[1], "+.3f", MILLIRADIAN, "not wound"),
    Shown("S, mm", lambda error: error[2], "+.4f", MILLIMETRE, "not wound"),
)
_CHECKS = (
    Shown("check", lambda check: check.name.rstrip(",")),
    Shown("value", lambda check: check.value, ".3g"),
    Shown("doubtful above", lambda check: check.warned_from, ".3g"),
    Shown("refused from", lambda check: check.refused_from, ".3g"),
    Shown("verdict", lambda check: "doubtful" if check.warned else "ok"),
)


@with_options(RunParameters)
def predict(
    typed: Typed,
    *,
    cell: Annotated[
        Path | None,
        typer.Argument(help="Cell file with any of these options, see `winding cell init`."),
    ] = None,
    cable: Cable = None,
    library: Library = None,
    json_file: Json = None,
    check: Annotated[
        bool, typer.Option("--check", help="Only check whether the solver can be right about it.")
    ] = False,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", help="Also write path, tension and twist over time to this table."),
    ] = None,
    vtk_file: Annotated[
        Path | None,
        typer.Option(
            "--vtk",
            help="Also write them for ParaView: this file, ending in .pvd, and a folder beside it.",
        ),
    ] = None,
    pictures: Annotated[
        int, typer.Option(help="Times over the run that --csv and --vtk have; 2 or more.")
    ] = 201,
    richardson: Annotated[
        bool,
        typer.Option(
            "--richardson",
            help="Also estimate the discretisation error of S and theta, from winding again with "
            "elements of half the length; takes five times as long.",
        ),
    ] = False,
    output: Annotated[
        list[Path] | None,
        typer.Option(help="Result, table or ParaView's file, by its ending; may be repeated."),
    ] = None,
    force: Force = False,
) -> None:
    """Predict where every marker ends up, how much cable is used, and how far to trust it."""
    given = {".json": json_file, ".csv": csv_file, ".pvd": vtk_file}
    json_file, csv_file, vtk_file = by_suffix(output or (), given)
    for option, file in (("--json", json_file), ("--csv", csv_file), ("--vtk", vtk_file)):
        check_output_file(file, option, force=force)
    if vtk_file is not None and vtk_file.suffix != ".pvd":
        refuse(f"--vtk needs a file whose name ends in .pvd, got {vtk_file}")
    if vtk_file is not None:
        check_output_folder(vtk_file.with_suffix(""), "--vtk", force=force)
    if pictures < 2:
        refuse(f"--pictures must be 2 or more, got {pictures}")
    with refused(ValueError), refused(SolverError, code=FAILED):
        run = wound_parameters(
            typed, cell=cell, cable=cable, library=library, spelling=spelled
        ).plan()
        if check:
            _print_checks(run)
            return
        if run.element != "rod" and (csv_file or vtk_file):
            refuse(f"--csv and --vtk tell of a rod, not of element {run.element}")
        _announce(run)
        words = f"winding with the {run.element}"
        with (
            cable_files(csv_file, vtk_file, run.frame_times(), pictures) as look,
            busy(words, TaskProgressColumn(), total=1.0) as show,
        ):
            result = run.wind(
                lambda share: show(completed=share, description=words), whole=False, look=look
            )
        record = _record(result, run.element)
        if richardson:
            with busy("winding again with elements of half the length"):
                error = discretisation_error(run, result)
            record["discretisation_error"] = {
                **json_values(error, "segment_m", "finer_segment_m"),
                "theta_rad": list(map(known, error.theta)),
                "s_m": list(map(known, error.s)),
            }
    _print(result, record)
    write_json(json_file, record)


def _print_checks(run: PlannedRun) -> None:
    console = result_console()
    title = "Whether the solver can be right about it"
    console.print(record_table(_CHECKS, run.checks(), words=1, title=title))
    with busy("estimating the time"):
        cost = expected_cost(run, time.process_time)
    console.print(cost_sentences(run, cost))


def _announce(run: PlannedRun) -> None:
    """Print on stderr what is worth doubting, and how long it takes where it takes long."""
    console = Console(stderr=True, highlight=False)
    for check in run.checks():
        if check.warned:
            console.print(f"doubtful: {check.sentence}", soft_wrap=True)
    if run.element == "rod" and run.duration / run.config.resolved.step < _FEW_STEPS:
        return
    with busy("estimating the time"):
        cost = expected_cost(run, time.process_time)
    if cost.cpu_seconds < _LONG_S:
        return
    faster = ""
    if cost.scaled_cpu_seconds < 0.5 * cost.cpu_seconds:
        faster = (
            f"; with --mass-scaling {cost.mass_scaling:g}, which leaves the cable where it is, "
            f"about {cost.scaled_cpu_seconds:.2g} s"
        )
    console.print(
        f"this takes about {cost.cpu_seconds:.2g} s of processor time{faster}", soft_wrap=True
    )


def _print(result: Prediction, record: dict[str, Any]) -> None:
    console = result_console()
    case = f"case {record['case']}" if record["case"] else "own condition"
    title = f"Markers after {result.duration:g} s, {case}, {record['element']}"
    console.print(record_table(_MARKERS, record["markers"], title=title))
    columns = ("cable_per_turn_m", "pitch_per_turn_m", "lies_per_turn")
    per_turn = zip(*(record[name] for name in columns), strict=True)
    turns = ((n, *both) for n, both in enumerate(per_turn, start=1))
    console.print(record_table(_TURNS, turns, title="Turns"))
    energies = ", ".join(f"{name} {joule:.3g}" for name, joule in record["energy_j"].items())
    tension = result.cable["tension"]
    laid = max(2, result.arc.size)
    console.print(
        f"law {result.config.law}: stretch {result.stretch:.5f}, closed form "
        f"{result.stretch_closed_form:.5f} at the wound tension, {result.span_stretch:.5f} in the "
        f"span\ntension: wound {tension[:laid].min():.3f} to {tension[:laid].max():.3f} N, "
        f"span {tension[-1]:.3f} N\nenergy [J]: {energies}; "
        f"balance open by {record['energy_balance_pct']:.3g} %, "
        f"kinetic over internal {record['kinetic_over_internal']:.2g}\n"
        f"speed: {result.cpu_s_per_sim_s:.4f} CPU seconds per simulated second"
    )
    if "discretisation_error" in record:
        error = record["discretisation_error"]
        per_marker = zip(error["theta_rad"], error["s_m"], strict=True)
        errors = ((n, *both) for n, both in enumerate(per_marker, start=1))
        title = (
            f"Estimated discretisation error, elements of {error['segment_m'] / MILLIMETRE:.3g} mm "
            f"against {error['finer_segment_m'] / MILLIMETRE:.3g} mm"
        )
        console.print(record_table(_ERRORS, errors, title=title))


def _record(result: Prediction, element: str) -> dict[str, Any]:
    energy = result.energy
    return {
        "element": element,
        "law": result.config.law,
        "case": result.config.case.number,
        "markers": [
            {
                "id": int(row["id"]),
                "theta_rad": float(row["theta"]),
                "z_m": float(row["z"]),
                "s_m": float(row["s"]),
                "wound": not row["flags"],
            }
            for row in result.markers[1:]
        ],
        "cable_per_turn_m": result.cable_per_turn().tolist(),
        "pitch_per_turn_m": result.pitch_per_turn().tolist(),
        "lies_per_turn": list(result.lies_per_turn()),
        "cable": {"s_m": result.cable["s"].tolist(), "tension_n": result.cable["tension"].tolist()},
        "energy_j": {name: joule for name, joule in vars(energy).items() if name != "initial"},
        "energy_balance_pct": energy.balance_pct,
        "kinetic_over_internal": energy.kinetic_over_internal,
        **json_values(result, "stretch", "stretch_closed_form", "span_stretch", "cpu_s_per_sim_s"),
    }


@contextmanager
def cable_files(
    csv_file: Path | None, vtk_file: Path | None, times: FloatArray, pictures: int
) -> Iterator[Look]:
    """Yield what looks at the model of a rod; the files are there when the body has ended.

    Args:
        csv_file: Table to write; None for none.
        vtk_file: ParaView's collection to write, with a folder of its name beside it; None for
            none.
        times: All times of the run [s], ascending.
        pictures: How many of them are written.
    """
    if csv_file is None and vtk_file is None:
        yield lambda _model: None
        return
    from winding_reports.records.cable_series import CableFile, CableSampler, CableTable, VtkSeries

    files: list[CableFile] = []
    with ExitStack() as stack:
        if csv_file is not None:
            table = stack.enter_context(staged(csv_file))
            target = stack.enter_context(table.open("w", encoding="utf-8", newline=""))
            files.append(CableTable(target))
        series: VtkSeries | None = None
        if vtk_file is not None:
            folder = vtk_file.with_suffix("")
            collection = stack.enter_context(staged(vtk_file))
            series = VtkSeries(stack.enter_context(staged(folder)))
            files.append(series)
        yield CableSampler(files, times, pictures).look
        if series is not None:
            series.write_collection(collection, folder.name)


def cost_sentences(run: PlannedRun, cost: ExpectedCost) -> str:
    """Return the element and the step that a run is wound with, and what it takes."""
    resolved = run.config.resolved
    return (
        f"elements of {resolved.segment / MILLIMETRE:.4g} mm, steps of {resolved.step:.3g} s, "
        f"stretch {resolved.stretch:.5g} in the span, tension {resolved.tension:.4g} N there and "
        f"{resolved.wound_tension(resolved.tension):.4g} N on the cylinder\n"
        f"winding {run.duration:g} s takes about {cost.cpu_seconds:.2g} s of processor time "
        f"({cost.steps} steps of {cost.elements:.0f} elements); up to a mass scaling of "
        f"{cost.mass_scaling:g} the cable lies the same, which takes about "
        f"{cost.scaled_cpu_seconds:.2g} s"
    )
