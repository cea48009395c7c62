"""The tracked run that a recording or a table of markers holds."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from cable_fem_node.winding.winding_config import WindingConfig
from winding_cli.terminal.record_options import Typed, spelled
from winding_study.run_parameters import RunParameters

if TYPE_CHECKING:
    from cable_fem_node.identification import TrackedRun


def tracked_run(source: Path, typed: Typed) -> TrackedRun:
    """Return the run of a recording (folder, .mcap) or of a table of markers (.csv).

    Args:
        source: Recording or table.
        typed: Options of what was wound; a recording holds it where nothing is typed.

    Raises:
        SourceError: It is missing, or the options ask for a solid.
        ValueError: It cannot be read, or does not hold what a run needs.
    """
    from cable_fem_node.identification import TrackedRun
    from winding_core.run_inputs import planned_inputs
    from winding_recorder.bags.tables import topic_rows
    from winding_study.identification.sources import SourceError, read_readings, recorded_run

    element = typed.get("element", RunParameters.element)
    if element != "rod":
        raise SourceError(f"identification winds the rod, not the element {element}")
    if not source.exists():
        raise SourceError(f"{source} does not exist")
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
    from winding_recorder.bags.contents import configuration_of, recorded_parameters
    from winding_recorder.bags.description import BagError
    from winding_ros.topics import FEM

    if "case" in typed or "cylinder_diameter_mm" in typed:
        return RunParameters.from_typed(typed, spelling=spelled).plan().config
    try:
        stated = recorded_parameters(source, FEM)
    except BagError as error:
        raise BagError(f"{source} does not say what was wound: give --case") from error
    config = configuration_of(FemParameters, stated, FEM).winding_config()
    return dataclasses.replace(config, law=str(typed.get("law", RunParameters.law)))
