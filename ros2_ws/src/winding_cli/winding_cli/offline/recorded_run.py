"""The record of a run that was recorded."""

from pathlib import Path
from typing import Any

from winding_cli.run.outcome import asked_extent
from winding_cli.run.record import run_record
from winding_core.cable.condition import Condition
from winding_core.lay.drum_parameters import DrumParameters
from winding_core.parameters import declared_in
from winding_core.run_options import LayWish, OperatorLimits
from winding_core.run_outcome import Cause, EndedBy, Ending
from winding_recorder.bags.contents import configuration_of
from winding_recorder.playback.recorded_buffer import recorded_run
from winding_reports.records.identity import Origin
from winding_reports.records.run_record import RunRecord, run_json
from winding_ros import topics
from winding_supervisor.session.session import RunResult


def record_of(source: Path, limits: OperatorLimits) -> tuple[RunRecord, RunResult]:
    """Return the record of a recording, and what it has of the run's result.

    Args:
        source: Recording, a folder or one storage file.
        limits: Of a lay that was driven, and of the errors of the lengths.

    Raises:
        BagError: The recording cannot be read, or has no condition of what was wound.
    """
    run = recorded_run(source)
    condition = configuration_of(Condition, run.parameters[topics.FEM], topics.FEM)
    control = run.parameters.get(topics.LAY_CONTROL, {})
    wish: Any = declared_in(LayWish, control) | declared_in(DrumParameters, control)
    cause = None
    if run.ended:
        cause = Cause(by=EndedBy.UNKNOWN, source=source.name, text=run.ended)
    result = RunResult(
        buffer=run.buffer,
        wall_s=0.0,
        ending=Ending(cause=cause),
        simulated=topics.RIG in run.parameters,
        bags=(source,),
    )
    record = run_record(
        condition,
        result,
        wish,
        limits,
        asked=asked_extent(condition, None),
        parameters=run.parameters,
        origin=_origin(run.origin),
    )
    return record, result


def recorded_numbers(source: Path) -> dict[str, Any]:
    """Return what `winding bag report` would write of a recording into run.json.

    Raises:
        BagError: The recording cannot be read, or has no condition of what was wound.
    """
    return run_json(record_of(source, OperatorLimits())[0])


def _origin(text: str) -> Origin | None:
    """Return which run a recording is of; None where it does not name one."""
    try:
        return Origin.from_text(text) if text else None
    except ValueError:
        return None
