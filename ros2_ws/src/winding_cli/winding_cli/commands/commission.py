"""`winding commission`: one run that is chosen for its information on cable and machine."""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cable_fem_node.winding.rig_prior import CELL, RigPrior
from cable_fem_node.winding.winding_config import SolverParameters, WindingConfig
from winding_cli.run.configuration import configured, warn_of_slowness
from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import (
    check_output_file,
    check_output_folder,
    write_json,
    write_text,
)
from winding_cli.terminal.record_options import Typed, spelled, with_options_of_run
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_core.catalogue.cables import check_name
from winding_core.machine.axes import MachineAxes
from winding_core.machine.tension import DeadWeight
from winding_core.parameters import ParameterError, build, declared_in, typed_values
from winding_core.run_spec import RunSpec
from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from winding_cli.run.delivery import RunDelivery
    from winding_study.commissioning.design import Expected
    from winding_study.commissioning.motion import MachineReach, Motion

_FULL_TURN = 2.0 * math.pi
# What the machine does is chosen, and what is known of the tension is looked for: a cell file may
# hold these for other runs.
_CHOSEN = (
    *("feed_mm_s", "omega_rad_s", "duration_s", "turns", "wound_length_mm"),
    *("tension_share", "tension_offset_n", "tension_diameter_gain_n", "tension_start_share"),
    "tension_build_up_mm",
)
# What such a run cannot have.
_EXCLUDED = (
    *("control", "program", "pitch_mm", "markers_every_turn", "brake", "layers", "length_m"),
    *("prony", "dashboard", "attach", "secure"),
)
_OF_DRIVE = ("feed_mm_s", "omega_rad_s")
# Pulls that the simulated machine's brake is asked for, as shares of the weight.
_PULL_SHARE = (0.3, 1.5)
# Markers that a design may count on, where their number is not configured.
_MOST_MARKERS = 64
_PROBED = 3.0  # How long an external machine is listened to [s]
_SHOWN = 6
_DRAWS = 1500


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A run that is designed, before anything moves."""

    config: WindingConfig  # Of the cell as it is known
    prior: RigPrior  # What was known
    reach: MachineReach  # Of the machine
    design: list[Expected]  # Every motion, the most telling first

    @property
    def motion(self) -> Motion:
        """What is wound."""
        return self.design[0].motion


@with_options_of_run(RigPrior)
def commission(
    typed: Typed,
    known: Typed,
    *,
    cell: Annotated[
        Path | None, typer.Argument(help="Cell file of the machine, see `winding cell init`.")
    ] = None,
    name: Annotated[str, typer.Option(help="Of the cable that is found.")] = "commissioned",
    cell_file: Annotated[
        Path | None, typer.Option(help="Cell file to write; else found-cell.yaml of the run.")
    ] = None,
    cable_file: Annotated[
        Path | None, typer.Option(help="Cable file to write; else NAME.yaml of the run.")
    ] = None,
    travel_mm: Annotated[
        float, typer.Option(help="Way of the carriage that the camera sees, in mm.")
    ] = 100.0,
    carriage_limit_mm_s: Annotated[
        float, typer.Option(help="Largest speed of the carriage, in mm/s.")
    ] = 80.0,
    pull_limits_n: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Smallest and largest pull of the machine's brake, in N."),
    ] = None,
    longest_s: Annotated[float, typer.Option(help="Longest motion, 60 s at most.")] = 60.0,
    plan: Annotated[
        bool, typer.Option("--plan", help="Choose the motion and print it; nothing moves.")
    ] = False,
) -> None:
    """Wind one run that is chosen for what it tells, and write the cell and the cable found."""
    for path, option in ((cell_file, "--cell-file"), (cable_file, "--cable-file")):
        check_output_file(path, option, make_folder=True)
    with refused(ValueError):
        check_name(name)
        base = RunSpec.from_cell(cell, typed, spelled)
        _refuse_chosen(base)
        check_output_folder(base.path("output"), "--output", new=True)
        planned = _planned(base, known, travel_mm, carriage_limit_mm_s, pull_limits_n, longest_s)
    console = result_console()
    console.print(_design_table(planned.design))
    console.print(f"chosen: {planned.motion.sentence}", soft_wrap=True)
    if plan:
        return
    with refused(ValueError):
        spec = RunSpec.from_cell(cell, {**typed, **_run_options(base, planned)}, spelled)
    _learn(base, planned, _wound(spec, planned.motion), name, cell_file, cable_file)


def _refuse_chosen(spec: RunSpec) -> None:
    chosen = [key for key in _CHOSEN if not (spec.external and key in _OF_DRIVE)]
    typed = [key for key in chosen if key in spec.source.typed]
    typed += [key for key in _EXCLUDED if spec.given.get(key)]
    if typed:
        raise ParameterError(
            f"{spec.source.name(typed[0])} is not for a commissioning run, which chooses motion "
            "and pull itself and finds what is unknown"
        )
    if spec.solver.element != "rod":
        raise ParameterError(
            f"a cell is identified with the rod, not the element {spec.solver.element}"
        )
    if not spec.camera.camera:
        raise ParameterError("a commissioning run needs a camera: it learns from tracked markers")
    spec.condition.resolved().case.material.refuse_fading("a commissioning run")


def _planned(
    spec: RunSpec,
    known: Typed,
    travel_mm: float,
    carriage_limit_mm_s: float,
    pull_limits: tuple[float, float] | None,
    longest: float,
) -> Plan:
    """Return the design of a run.

    Raises:
        ParameterError: The limits allow no motion.
        ValueError: The cable cannot be wound.
    """
    from winding_study.commissioning.design import ranked
    from winding_study.commissioning.motion import (
        MachineReach,
        candidates,
        clearing_advance,
        safe_pulls,
    )

    ranges: dict[str, Any] = typed_values(RigPrior, known, spelled)
    prior = replace(CELL, **ranges)
    what = spec.condition.resolved()
    markers = what.case.marker_count if "markers" in spec.given else _MOST_MARKERS
    what = replace(what, case=replace(what.case, marker_count=markers), tension_law=DeadWeight())
    config = build(SolverParameters, spec.asked("solver"), owner="winding commission").config_of(
        what
    )
    drive, weight = what.drive, what.case.weight
    pulls = pull_limits
    if pulls is None and not spec.external:
        pulls = safe_pulls(what.case, prior, (_PULL_SHARE[0] * weight, _PULL_SHARE[1] * weight))
    if pulls is not None:
        # Refuses a pull that would tear the cable as it is known.
        replace(config, case=replace(what.case, weight=pulls[1]))
    lag = what.free_length / what.case.centreline_radius
    reach = MachineReach(
        speeds=(drive.angular_speed, drive.angular_speed),
        carriage_speed=carriage_limit_mm_s * MILLIMETRE,
        feed=drive.feed_speed if spec.external else None,
        travel=travel_mm * MILLIMETRE,
        clear=0.0 if spec.external else clearing_advance(what.case.cable_diameter, lag),
        weight=weight,
        pulls=pulls,
        ramp_time=drive.ramp_time,
        longest=longest,
    )
    sign = math.copysign(1.0, drive.feed_speed)
    with busy("choosing the motion"):
        design = ranked(config, candidates(reach, sign), prior)
    return Plan(config=config, prior=prior, reach=reach, design=design)


def _run_options(spec: RunSpec, planned: Plan) -> dict[str, Any]:
    """Return the options of `winding run` that make the chosen motion."""
    motion, best = planned.motion, planned.design[0]
    found: dict[str, Any] = {}
    if "markers" not in spec.given:
        found["markers"] = min(_MOST_MARKERS, best.markers + 1)
    if spec.external:
        return found | {"turns": motion.end_angle / _FULL_TURN}
    if "lay" not in spec.given:
        found["lay"] = "driven"
    return found | {
        "omega_rad_s": motion.drive.angular_speed,
        "feed_mm_s": motion.drive.feed_speed / MILLIMETRE,
        "duration_s": motion.duration,
    }


def _wound(spec: RunSpec, motion: Motion) -> RunDelivery:
    """Wind the run through the graph; end the command where it is not whole."""
    from winding_cli.run.delivery import RunDelivery
    from winding_cli.run.winding import wind
    from winding_cli.terminal.origin import origin_here
    from winding_recorder.bags.description import ORIGIN

    if spec.external:
        _conform(spec)
    origin = replace(origin_here(), labels=spec.labels)
    with refused(ValueError):
        config = configured(spec, {ORIGIN: origin.text})
    if motion.commands_pull:
        config = replace(config, pulls=tuple(zip(motion.angles, motion.pulls, strict=True)))
    warn_of_slowness(config)
    delivery = RunDelivery(config, origin)
    failure = wind(config, delivery)
    missing = _missing(delivery)
    if failure is not None:
        reason = missing if delivery.result is not None else ""
        print(f"winding: no result: {reason or 'the run was broken off'}", flush=True)
        failure()
    if missing:
        refuse(f"no result: {missing}", FAILED)
    return delivery


def _missing(delivery: RunDelivery) -> str:
    """Return why the run that was wound leaves nothing to learn from; empty where it is whole."""
    if delivery.result is None or delivery.outcome is None:
        return "nothing was wound"
    if not delivery.outcome.complete:
        return delivery.outcome.headline
    return next(iter(delivery.result.losses), "")


def _conform(spec: RunSpec) -> None:
    """Refuse an external machine that does not keep the interface."""
    from winding_cli.commands.conform import probed
    from winding_cli.terminal.ros_environment import joined

    axes = MachineAxes(**declared_in(MachineAxes, spec.asked("machine")))
    with joined(spec.domain):
        try:
            findings, _ = asyncio.run(
                probed(
                    spec.graph.namespace, transport=spec.camera.image_transport, axes=axes,
                    seconds=_PROBED, running=None, stop_within=0.0,
                )
            )  # fmt: skip
        except TimeoutError as error:
            refuse(f"the machine does not conform: {error}")
    broken = [item for item in findings if not item.kept]
    if broken:
        refuse(f"the machine does not conform: {broken[0].promise}: {broken[0].measured}")


def _learn(
    spec: RunSpec,
    planned: Plan,
    delivery: RunDelivery,
    name: str,
    cell_file: Path | None,
    cable_file: Path | None,
) -> None:
    """Identify the cell from the run, print and write what was found."""
    from cable_fem_node.identification import IdentificationError, identify_rig
    from winding_cli.offline.identified import beliefs_table
    from winding_cli.run.tracked_lap import measured_run
    from winding_study.commissioning.design import ranked
    from winding_study.commissioning.motion import candidates
    from winding_study.commissioning.result import (
        cable_of,
        cell_text_of,
        commissioning_record,
        remarks,
    )

    assert delivery.result is not None
    sign = math.copysign(1.0, planned.motion.drive.feed_speed)
    with refused(IdentificationError, code=FAILED), busy("identifying the cell"):
        run, clock = measured_run(delivery.result.buffer, planned.config, planned.motion)
        posterior = identify_rig([run], planned.prior, draws=_DRAWS)
        following = ranked(
            planned.config, candidates(planned.reach, sign), planned.prior, posterior
        )
    console = result_console()
    console.print(beliefs_table(posterior.found, "What was found, 90 % intervals"))
    for sentence in (*remarks(posterior, following), clock):
        console.print(sentence, soft_wrap=True)
    source = f"commissioning run {delivery.directory}"
    cable_file = cable_file or delivery.directory / f"{name}.yaml"
    cell_file = cell_file or delivery.directory / "found-cell.yaml"
    cable = cable_of(name, spec, posterior, source)
    write_text(cable_file, cable.text())
    with refused(ValueError, code=FAILED):
        text = cell_text_of(spec, posterior, str(cable_file), source)
    write_text(cell_file, text)
    record = commissioning_record(posterior, planned.design[:_SHOWN], following[:_SHOWN])
    write_json(delivery.directory / "commissioning.json", record)
    console.print(f"cable: {cable_file}\ncell: {cell_file}", soft_wrap=True)


def _design_table(design: list[Expected]) -> Any:
    columns = (
        Shown("expected, nat", lambda item: item.gain, ".1f"),
        Shown("markers", lambda item: item.markers),
        Shown("motion", lambda item: item.motion.sentence),
        Shown("narrows most", lambda item: item.most),
    )
    return record_table(columns, design[:_SHOWN], title="Motions by what they are expected to tell")
