"""`winding plan`: the machine motion that lays a program, and what is out of reach."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from cable_fem_node.dynamics.state import SolverError
from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.expected_landing import ExpectedLanding, expected_landings
from lay_control_node.control.guide_law import WantedProgram
from lay_control_node.planning.lay_plan import (
    FULL_TURN,
    PERIOD,
    LayPlan,
    csv_text,
    plan_record,
    plan_turns,
)
from lay_control_node.planning.planner import plan_lay
from lay_control_node.programs import even_helix, read_program, with_markers_every_turn
from lay_control_node.programs.points import MOST_TURNS
from winding_cli.offline.filled_drum import print_drum
from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import (
    Force,
    Json,
    by_suffix,
    check_output_file,
    staged,
    write_json,
    write_text,
)
from winding_cli.terminal.record_options import (
    Cable,
    Library,
    Typed,
    spelled,
    typed_with_cable,
    with_options,
)
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_core.arm.opening import check_arm, open_arm
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.layers import WoundDrum
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.parameters import typed_record
from winding_core.units import MILLIMETRE, json_values, known
from winding_study.plans.drum_plan import DrumPlanParameters, PlanParameters, drum_record
from winding_study.run_parameters import RunParameters

if TYPE_CHECKING:
    from winding_study.plans.solver_check import SolverLay

STARTS = ("first", "together")
# What a marker is asked to keep under control [rad]: the first one lands before any is measured.
_FIRST, _LATER = 0.02 * FULL_TURN, 0.01 * FULL_TURN


@with_options(RunParameters, PlanParameters, DrumPlanParameters)
def plan(
    typed: Typed,
    typed_limits: Typed,
    typed_drum: Typed,
    *,
    program: Annotated[
        Path | None,
        typer.Argument(help="Lay program: .csv, .yaml, or .gcode, .nc, .ngc; see lay-control.md."),
    ] = None,
    cable: Cable = None,
    library: Library = None,
    even: Annotated[
        bool, typer.Option("--even", help="An even helix of the condition's own pitch.")
    ] = False,
    pitch_mm: Annotated[
        float | None,
        typer.Option(help="An even helix of this pitch, or that of turns on a drum, in mm."),
    ] = None,
    turns: Annotated[
        float | None,
        typer.Option(help="Turns of an even helix; otherwise those of the condition's duration."),
    ] = None,
    markers_every_turn: Annotated[
        bool, typer.Option("--markers-every-turn", help="Marker n is wanted after n turns.")
    ] = False,
    start: Annotated[
        str,
        typer.Option(
            help="Whether the guide takes its place ahead of the cable before the cylinder turns, "
            "or while it ramps: first, together."
        ),
    ] = "first",
    tolerance_mm: Annotated[
        float | None, typer.Option(help="Exit code 1 where the cable would lie further off, in mm.")
    ] = None,
    slow_down: Annotated[
        bool,
        typer.Option("--slow-down", help="Slow the cylinder at corners to keep the tolerance."),
    ] = False,
    solver: Annotated[
        bool | None,
        typer.Option(
            "--solver/--no-solver",
            help="Wind the plan with the rod as well; on a drum where it is asked for.",
        ),
    ] = None,
    machine_file: Annotated[
        str, typer.Option(help="File of an arm that carries the guide: refuse what it cannot do.")
    ] = "",
    picture: Annotated[Path | None, typer.Option(help="Draw the plan: .png, .svg or .pdf.")] = None,
    json_file: Json = None,
    csv_file: Annotated[
        Path | None,
        typer.Option("--csv", help="Write t_s, cylinder_rad, guide_m, tension_n for a PLC."),
    ] = None,
    period_ms: Annotated[float, typer.Option(help="Time between rows of the CSV, in ms.")] = 10.0,
    output: Annotated[
        list[Path] | None,
        typer.Option(help="Plan, table or picture to write, by its ending; may be repeated."),
    ] = None,
    force: Force = False,
) -> None:
    """Plan the machine's motion that lays a program, and report what is out of reach, and why."""
    given = {".json": json_file, ".csv": csv_file, ".png .svg .pdf": picture}
    json_file, csv_file, picture = by_suffix(output or (), given)
    for option, path in (("--picture", picture), ("--json", json_file), ("--csv", csv_file)):
        check_output_file(path, option, force=force)
    _check_options(start, tolerance_mm, slow_down, picture, period_ms, turns)
    laid: SolverLay | None = None
    with refused(ValueError), refused(SolverError, code=FAILED):
        typed = typed_with_cable(typed, cable, library)
        parameters = RunParameters.from_typed(typed, spelling=spelled, case=None)
        what = parameters.resolved(spelled)
        on_drum = DrumPlanParameters.from_options(typed_drum, spelling=spelled)
        drum = on_drum.drum(what.case)
        programmed = program is not None or even or turns is not None or markers_every_turn
        filled = drum is not None and (on_drum.filled or not programmed)
        solver = drum is None if solver is None else solver
        if solver and parameters.element != "rod":
            refuse(f"a plan is wound with the rod, not with the element {parameters.element}")
        limits = typed_record(PlanParameters, typed_limits, spelled).limits()
        config = replace(parameters.config_of(what), drum=drum)
        wound: WoundDrum | None = None
        if filled:
            if programmed:
                refuse(
                    "a drum has a program of its own: leave out the file, --even, --turns and "
                    "--markers-every-turn, or --layers and --length-m"
                )
            what = on_drum.paced(what)
            wound = on_drum.wind(what.case, None if pitch_mm is None else pitch_mm * MILLIMETRE)
            wanted = on_drum.program(wound, what, limits)
        else:
            wanted = _wanted(program, what, even, pitch_mm, turns, markers_every_turn)
            if drum is not None:
                drum.refuse_beyond(wanted.theta, wanted.z, what.case.cable_diameter)
        plan_with = functools.partial(
            plan_lay,
            wanted,
            what,
            limits,
            residual_limit=tolerance_mm * MILLIMETRE if tolerance_mm and slow_down else None,
            together=start == "together",
            even_cable=wound is not None,
        )
        if solver:
            from winding_study.plans.solver_check import plan_with_solver

            with busy("winding the plan with the rod"):
                planned, laid = plan_with_solver(lambda lag: plan_with(lag=lag), config)
        else:
            planned = plan_with()
        rows = planned.samples(planned.times(PERIOD))
        arm = open_arm(machine_file, what)
        check_arm(arm, what, rows.guide, float(np.abs(np.diff(rows.guide)).max()) / PERIOD)
        controlled = _controlled(planned)
    drum_as_planned = None if wound is None else drum_record(planned, wound)
    print_plan(result_console(), planned, laid, controlled, drum_as_planned)
    missed = verdict(planned, laid, tolerance_mm)
    record = plan_record(planned)
    record |= {
        "solver": solver_record(laid),
        "under_control": control_record(controlled),
        "drum": drum_as_planned,
        "tolerance_mm": tolerance_mm,
        "missed": missed,
    }
    if csv_file is not None:
        write_text(csv_file, csv_text(planned, 1.0e-3 * period_ms))
    if picture is not None:
        from winding_study.plans.plan_picture import write_plan_picture

        with staged(picture) as place:
            write_plan_picture(planned, laid, place, picture.suffix.lower())
    write_json(json_file, record)
    if missed:
        refuse(missed, FAILED)


def _check_options(
    start: str,
    tolerance: float | None,
    slow_down: bool,
    picture: Path | None,
    period: float,
    turns: float | None,
) -> None:
    from winding_study.plans.plan_picture import PICTURE_KINDS

    if start not in STARTS:
        refuse(f"--start must be {' or '.join(STARTS)}, got {start!r}")
    if tolerance is not None and not 0.0 < tolerance < 1.0e6:
        refuse(f"--tolerance-mm must be positive and finite, got {tolerance:g}")
    if slow_down and tolerance is None:
        refuse("--slow-down needs --tolerance-mm")
    if turns is not None and not 0.0 < turns <= MOST_TURNS:
        refuse(f"--turns must lie above 0 and up to {MOST_TURNS:g}, got {turns:g}")
    if not 1.0 <= period <= 1000.0:
        refuse(f"--period-ms must lie in 1 to 1000, got {period:g}")
    if picture is not None and picture.suffix.lower() not in PICTURE_KINDS:
        refuse(f"--picture ends in {', '.join(PICTURE_KINDS)}, got {picture.name!r}")


def _wanted(
    file: Path | None,
    what: ResolvedCondition,
    even: bool,
    pitch_mm: float | None,
    turns: float | None,
    markers_every_turn: bool,
) -> LayProgram:
    given = [file is not None, even, pitch_mm is not None]
    if sum(given) != 1:
        raise LayProgramError(
            "say once what is wanted: a program file, --even or --pitch-mm, "
            f"got {sum(given)} of them"
        )
    if file is not None:
        if turns is not None:
            raise LayProgramError("--turns goes with --even or --pitch-mm, a file has its own")
        program = read_program(file, radius=what.case.centreline_radius)
    else:
        if turns is None:
            turns = float(what.drive.positions(what.duration)[0]) / FULL_TURN
        pitch = what.drive.pitch if pitch_mm is None else MILLIMETRE * pitch_mm
        program = even_helix(pitch, turns, name=f"helix of {pitch / MILLIMETRE:.4g} mm")
    if markers_every_turn:
        program = with_markers_every_turn(program, what.case.marker_count)
    return program


def _controlled(planned: LayPlan) -> tuple[ExpectedLanding, ...]:
    """Return where wanted markers land if the lay is controlled; none without a brake."""
    limits, what, program = planned.limits, planned.what, planned.program
    if limits.brake is None or not program.markers:
        return ()
    control = ControlParameters(pull_range=list(limits.pull_share))
    wanted = WantedProgram.of(program, what, limits)
    return expected_landings(control, what, wanted, program.markers)


def print_plan(
    console: Console,
    plan: LayPlan,
    solver: SolverLay | None,
    controlled: tuple[ExpectedLanding, ...] = (),
    drum: dict[str, Any] | None = None,
) -> None:
    """Print the lay turn by turn or layer by layer, the markers, and what is out of reach."""
    if drum is None:
        console.print(_turns(plan, solver))
    else:
        print_drum(console, drum)
    if any(math.isfinite(item.wanted) for item in plan.landings):
        console.print(_markers(plan, solver, controlled))
    planned, uncompensated = (value / MILLIMETRE for value in plan.rms())
    worst, where = plan.worst
    lines = [
        f"off the program by {planned:.3g} mm rms after the first turn, uncompensated by "
        f"{uncompensated:.3g} mm; at most {worst / MILLIMETRE:.3g} mm, at turn "
        f"{where / FULL_TURN:.2f}"
    ]
    if solver is not None:
        worst, where = solver.worst
        lines.append(
            f"by the solver {solver.rms() / MILLIMETRE:.3g} mm rms, at most "
            f"{worst / MILLIMETRE:.3g} mm, at turn {where / FULL_TURN:.2f}"
        )
    lines.append(
        f"the machine moves for {plan.motion.end:.4g} s; lag {plan.lag:.3g} rad, corners are "
        f"rounded over {4.0 * plan.width:.3g} rad"
    )
    lines += [f"out of reach: {sentence}" for sentence in plan.sentences]
    lines += list(_uncertain(controlled))
    console.print("\n".join(lines), soft_wrap=True, markup=False)


def verdict(plan: LayPlan, solver: SolverLay | None, tolerance_mm: float | None) -> str:
    """Return why a tolerance [mm] is not kept; empty where it is, or where there is none."""
    if tolerance_mm is None:
        return ""
    found = {"the lag law": plan.worst}
    if solver is not None:
        found["the solver"] = solver.worst
    for name, (worst, where) in found.items():
        if worst > tolerance_mm * MILLIMETRE:
            return (
                f"by {name} the cable would lie {worst / MILLIMETRE:.3g} mm off at turn "
                f"{where / FULL_TURN:.2f}, the tolerance is {tolerance_mm:g} mm"
            )
    return ""


def control_record(controlled: tuple[ExpectedLanding, ...]) -> list[dict[str, Any]]:
    """Return where markers land under control as plain values."""
    return [
        {"id": item.number}
        | json_values(item, "wanted_rad", "expected_rad", "sigma_rad", "misses_rad")
        for item in controlled
    ]


def _uncertain(controlled: tuple[ExpectedLanding, ...]) -> Iterator[str]:
    """Yield which markers may miss their angles under control, and why."""
    missing = [i for i in controlled if not i.misses <= (_FIRST if i.number == 1 else _LATER)]
    for item in missing:
        if not math.isfinite(item.misses):
            yield f"under control P{item.number} may not land by the end"
            continue
        off, spread, at_most = (
            100.0 * value / FULL_TURN
            for value in (item.expected - item.wanted, 2.0 * item.sigma, item.misses)
        )
        yield (
            f"under control P{item.number} lands {off:+.2g} % of a turn from its place, give or "
            f"take {spread:.2g} % (two deviations), and by up to {at_most:.2g} % in an unusual rig"
        )
    if missing:
        yield (
            "under control the tension that reaches the cylinder is learnt from the markers that "
            "land, and the pull changes no faster than friction holds what lies"
        )


def solver_record(solver: SolverLay | None) -> dict[str, Any] | None:
    """Return the solver's lay as plain values; None without it."""
    if solver is None:
        return None
    worst, where = solver.worst
    return {
        "residual_rms_m": solver.rms(),
        "residual_worst_m": worst,
        "residual_worst_at_rad": where,
        "theta_rad": solver.theta.tolist(),
        "z_m": solver.z.tolist(),
        "markers_rad": list(map(known, solver.markers)),
    }


def _turns(plan: LayPlan, solver: SolverLay | None) -> Table:
    columns = [
        Shown("turn", lambda row: row[0], ".2f", FULL_TURN),
        Shown("wanted z, mm", lambda row: row[1], ".2f", MILLIMETRE),
        Shown("planned, mm", lambda row: row[2], ".2f", MILLIMETRE),
        Shown("off by, mm", lambda row: row[2] - row[1], ".3f", MILLIMETRE),
        Shown("uncompensated off by, mm", lambda row: row[3] - row[1], ".2f", MILLIMETRE),
    ]
    if solver is not None:

        def off(row: tuple[float, ...]) -> float:
            return float(solver.z_at(np.array([row[0]]))[0]) - row[1]

        columns.append(Shown("solver off by, mm", off, ".3f", MILLIMETRE))
    return record_table(columns, plan_turns(plan), title=plan.program.name)


def _markers(
    plan: LayPlan, solver: SolverLay | None, controlled: tuple[ExpectedLanding, ...]
) -> Table:
    under_control = {item.number: item for item in controlled}

    def reach(item: Any) -> str | None:
        if not math.isfinite(item.earliest):
            return None
        return f"{_in_turns(item.earliest)} to {_in_turns(item.latest)}"

    def controlled_place(item: Any) -> str:
        found = under_control.get(item.number)
        if found is None:
            return ""
        return f"{_in_turns(found.expected)} +- {2.0 * found.sigma / FULL_TURN:.4f}"

    columns = [
        Shown("marker", lambda item: f"P{item.number}"),
        Shown("wanted", lambda item: item.wanted, ".4f", FULL_TURN),
        Shown("planned", lambda item: item.predicted, ".4f", FULL_TURN),
        Shown("pull, N", lambda item: item.pull, ".3f"),
        Shown("in reach", reach),
    ]
    if solver is not None:
        landed = solver.markers
        columns.append(Shown("solver", lambda item: landed[item.number - 1], ".4f", FULL_TURN))
    if under_control:
        columns.append(Shown("under control, +- 2 sigma", controlled_place))
    return record_table(columns, plan.landings, title="Markers, in turns")


def _in_turns(angle: float) -> str:
    return f"{angle / FULL_TURN:.4f}" if math.isfinite(angle) else "-"
