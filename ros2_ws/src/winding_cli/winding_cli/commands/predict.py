"""`winding predict`: wind a run ahead of time, without ROS."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from winding_cli.commands.cable_files import cable_files
from winding_cli.commands.condition_options import Typed, spelled, with_options
from winding_cli.commands.console import progress_bar, result_console
from winding_cli.commands.output_path import check_output_file, write_json
from winding_cli.commands.refusal import refuse
from winding_cli.output.solver_checks import checks_table, cost_sentences
from winding_core.units import MILLIMETRE
from winding_study.run_parameters import RunParameters

if TYPE_CHECKING:
    from cable_fem_node.winding.discretisation import DiscretisationError
    from cable_fem_node.winding.prediction import Look, PlannedRun, Prediction

# A run of so few steps takes seconds, and is not timed beforehand.
_FEW_STEPS = 1.0e6
# Processor time that is announced [s].
_LONG_S = 5.0


@with_options(RunParameters)
def predict(
    typed: Typed,
    *,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the result to this file.")
    ] = None,
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
        int, typer.Option(help="How many times over the run --csv and --vtk tell; 2 or more.")
    ] = 201,
    richardson: Annotated[
        bool,
        typer.Option(
            "--richardson",
            help="Also estimate the discretisation error of S and theta, from winding again with "
            "elements of half the length; takes five times as long.",
        ),
    ] = False,
) -> None:
    """Predict where every marker ends up, how much cable is used, and how far to trust it."""
    from cable_fem_node.dynamics.failure import SolverError

    for option, file in (("--json", json_file), ("--csv", csv_file), ("--vtk", vtk_file)):
        check_output_file(file, option)
    if vtk_file is not None and vtk_file.suffix != ".pvd":
        refuse(f"--vtk needs a file whose name ends in .pvd, got {vtk_file}")
    if pictures < 2:
        refuse(f"--pictures must be 2 or more, got {pictures}")
    try:
        run = RunParameters.from_typed(typed, spelling=spelled).plan()
        if check:
            _print_checks(run)
            return
        if run.element != "rod" and (csv_file or vtk_file):
            raise ValueError(f"--csv and --vtk tell of a rod, not of element {run.element}")
        _announce(run)
        with cable_files(csv_file, vtk_file, run.frame_times(), pictures) as look:
            result = _wind(run, look)
        error_of = _discretisation(run, result) if richardson else None
    except (ValueError, SolverError) as error:
        refuse(error)
    _print(result, run.element)
    if error_of is not None:
        result_console().print(_error_table(error_of))
    if json_file is not None:
        write_json(json_file, _record(result, run.element) | _error_record(error_of))


def _print_checks(run: PlannedRun) -> None:
    from cable_fem_node.winding.expected_cost import expected_cost

    console = result_console()
    console.print(checks_table(run.checks()))
    cost = expected_cost(run, time.process_time)
    console.print(cost_sentences(run, cost), highlight=False)


def _announce(run: PlannedRun) -> None:
    """Say on stderr what is worth doubting, and how long it takes where it takes long."""
    from cable_fem_node.winding.expected_cost import expected_cost

    console = Console(stderr=True)
    for check in run.checks():
        if check.warned:
            console.print(f"doubtful: {check.sentence}", highlight=False, soft_wrap=True)
    if run.element == "rod" and run.duration / run.config.resolved.step < _FEW_STEPS:
        return
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
        f"this takes about {cost.cpu_seconds:.2g} s of processor time{faster}",
        highlight=False,
        soft_wrap=True,
    )


def _wind(run: PlannedRun, look: Look) -> Prediction:
    from cable_fem_node.dynamics.compile import is_compiled

    console = Console(stderr=True)
    if not is_compiled():
        console.print("compiling the solver's kernels: once after installation, a minute at most")
    if not console.is_terminal:
        return run.wind(whole=False, look=look)
    from rich.progress import TaskProgressColumn, TimeElapsedColumn

    with progress_bar(TaskProgressColumn(), TimeElapsedColumn()) as bar:
        task = bar.add_task(f"winding with the {run.element}", total=1.0)

        def show(share: float) -> None:
            bar.update(task, completed=share)

        return run.wind(show, whole=False, look=look)


def _discretisation(run: PlannedRun, result: Prediction) -> DiscretisationError:
    from cable_fem_node.winding.discretisation import discretisation_error

    return discretisation_error(run, result)


def _error_table(error: DiscretisationError) -> Table:
    table = Table(
        title=f"Estimated discretisation error, elements of {error.segment / MILLIMETRE:.3g} mm "
        f"against {error.finer_segment / MILLIMETRE:.3g} mm"
    )
    for column in ("marker", "theta, mrad", "S, mm"):
        table.add_column(column, justify="right")
    for n, (theta, s) in enumerate(zip(error.theta, error.s, strict=True), start=1):
        known = math.isfinite(theta)
        table.add_row(
            f"P{n}",
            f"{1.0e3 * theta:+.3f}" if known else "not wound",
            f"{s / MILLIMETRE:+.4f}" if known else "not wound",
        )
    return table


def _error_record(error: DiscretisationError | None) -> dict[str, Any]:
    if error is None:
        return {}
    return {
        "discretisation_error": {
            "segment_m": error.segment,
            "finer_segment_m": error.finer_segment,
            "theta_rad": [value if math.isfinite(value) else None for value in error.theta],
            "s_m": [value if math.isfinite(value) else None for value in error.s],
        }
    }


def _print(result: Prediction, element: str) -> None:
    console = result_console()
    case = result.config.case
    title = f"case {case.number}" if case.number else "own condition"
    table = Table(title=f"Markers after {result.duration:g} s, {title}, {element}")
    for column in ("marker", "theta, rad", "z, mm", "S, mm", "on the cylinder"):
        table.add_column(column, justify="right")
    for row in result.markers[1:]:
        table.add_row(
            f"P{row['id']}",
            f"{row['theta']:.3f}",
            f"{row['z'] / MILLIMETRE:.2f}",
            f"{row['s'] / MILLIMETRE:.2f}",
            "no" if row["flags"] else "yes",
        )
    console.print(table)
    turns = Table(title="Turns")
    for column in ("turn", "cable used, mm", "advance, mm"):
        turns.add_column(column, justify="right")
    for n, (used, pitch) in enumerate(
        zip(result.cable_per_turn(), result.pitch_per_turn(), strict=True), start=1
    ):
        turns.add_row(str(n), f"{used / MILLIMETRE:.2f}", f"{pitch / MILLIMETRE:.2f}")
    console.print(turns)
    energy, tension = result.energy, result.cable["tension"]
    laid = max(2, result.arc.size)
    console.print(
        f"law {result.config.law}: stretch {result.stretch:.5f}, closed form "
        f"{result.stretch_closed_form:.5f} at the wound tension, {result.span_stretch:.5f} in the "
        f"span\ntension: wound {tension[:laid].min():.3f} to {tension[:laid].max():.3f} N, "
        f"span {tension[-1]:.3f} N\nenergy [J]: kinetic {energy.kinetic:.3g}, "
        f"internal {energy.internal:.3g}, contact {energy.contact:.3g}, "
        f"external {energy.external:.3g}, friction {energy.friction:.3g}, "
        f"damping {energy.damping:.3g}, relaxation {energy.relaxation:.3g}; "
        f"balance open by {energy.balance_pct:.3g} %, "
        f"kinetic over internal {energy.kinetic_over_internal:.2g}\n"
        f"speed: {result.cpu_s_per_sim_s:.4f} CPU seconds per simulated second",
        highlight=False,
    )


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
        "cable": {
            "s_m": result.cable["s"].tolist(),
            "tension_n": result.cable["tension"].tolist(),
        },
        "energy_j": {
            name: getattr(energy, name)
            for name in (
                "kinetic",
                "internal",
                "contact",
                "external",
                "friction",
                "damping",
                "relaxation",
            )
        },
        "energy_balance_pct": energy.balance_pct,
        "kinetic_over_internal": energy.kinetic_over_internal,
        "stretch": result.stretch,
        "stretch_closed_form": result.stretch_closed_form,
        "span_stretch": result.span_stretch,
        "cpu_s_per_sim_s": result.cpu_s_per_sim_s,
    }
