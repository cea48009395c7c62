"""Whose machine a run winds with, as options of the command line say it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from winding_cli.commands.condition_options import Typed, spelled
from winding_cli.commands.refusal import refuse, refused
from winding_core.condition import ResolvedCondition
from winding_core.machine_axes import MachineAxes
from winding_core.options import typed_values
from winding_core.parameters import ParameterError, build, declarations
from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from winding_supervisor.machine.external_machine import ExternalMachineConfig

SIMULATED, EXTERNAL = "simulated", "external"


@dataclass(frozen=True, kw_only=True)
class MachineOptions:
    """What is typed of an external machine beside its axes.

    Attributes:
        camera: Whether it has one.
        start: How it begins: service or motion.
        turns: After which the run ends; None for the drive's.
        wound_length_mm: Undeformed cable after which the run ends [mm]; None for the drive's.
        standing_s: A machine that stands for longer has ended its run [s].
        lead: Way by which a controlled carriage goes ahead of the cable at first [m].
    """

    camera: bool = True
    start: str = "service"
    turns: float | None = None
    wound_length_mm: float | None = None
    standing_s: float = 60.0
    lead: float = 0.0


def machine_of(
    machine: str,
    axes: Typed,
    what: ResolvedCondition,
    options: MachineOptions,
    simulated: Mapping[str, object],
) -> ExternalMachineConfig | None:
    """Return the external machine that was asked for; None for the simulated one.

    Ends the command when the options contradict each other.

    Args:
        machine: simulated or external.
        axes: What was typed of its axes.
        what: Is wound.
        options: What was typed of it beside.
        simulated: What was typed that only the simulated machine takes, by option.
    """
    if machine not in (SIMULATED, EXTERNAL):
        refuse(f"--machine must be {SIMULATED} or {EXTERNAL}, got {machine}")
    if machine == SIMULATED:
        for name in (*axes, *_typed_beside(options)):
            refuse(f"{spelled(name)} needs --machine {EXTERNAL}")
        with refused(ParameterError):
            _check_numbers(simulated)
        return None
    for name, value in simulated.items():
        if value is not None:
            refuse(f"--{name} is for the simulated machine")
    _check(options)
    from winding_supervisor.machine.external_machine import ExternalMachineConfig

    return ExternalMachineConfig(
        axes=machine_axes(axes),
        drive=what.drive,
        end_angle=_end_angle(options, what),
        camera=options.camera,
        starts_itself=options.start == "motion",
        standing_limit=options.standing_s,
        lead=options.lead,
    )


def _check_numbers(simulated: Mapping[str, object]) -> None:
    """Hold the numbers that were typed, by option, against what the rig's parameters declare."""
    from winding_rig_node.ros.parameters import RigParameters

    declared = {spelled(item.name)[2:]: item for item in declarations(RigParameters)}
    for name, value in simulated.items():
        if isinstance(value, int | float) and name in declared:
            dataclasses.replace(declared[name], title=f"--{name}").convert(value)


def _typed_beside(options: MachineOptions) -> Iterator[str]:
    """Yield the options of an external machine that were typed, its axes aside."""
    usual = MachineOptions()
    if not options.camera:
        yield "no_camera"
    for name in ("start", "turns", "wound_length_mm", "standing_s"):
        if getattr(options, name) != getattr(usual, name):
            yield name


def machine_axes(typed: Typed) -> MachineAxes:
    """Return the axes that were typed; end the command when they contradict each other."""
    with refused(ParameterError, ValueError):
        return build(MachineAxes, typed_values(MachineAxes, typed, spelled), owner="the machine")


def _check(options: MachineOptions) -> None:
    if options.start not in ("service", "motion"):
        refuse(f"--start must be service or motion, got {options.start}")
    if options.turns is not None and options.wound_length_mm is not None:
        refuse("give --turns or --wound-length-mm, not both")
    for name, value in (
        ("turns", options.turns),
        ("wound-length-mm", options.wound_length_mm),
        ("standing-s", options.standing_s),
    ):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            refuse(f"--{name} must be positive, got {value}")


def _end_angle(options: MachineOptions, what: ResolvedCondition) -> float:
    """Return the angle [rad] at which the run ends."""
    if options.turns is not None:
        return 2.0 * math.pi * options.turns
    if options.wound_length_mm is not None:
        laid = math.hypot(what.case.centreline_radius, what.drive.advance_per_radian)
        return MILLIMETRE * options.wound_length_mm * what.case.expected_stretch / laid
    return float(what.drive.positions(what.duration)[0])
