"""The report and the numbers of a run that was recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winding_cli.commands.run_results import deliver, refuse_flawed, seed_of, show

if TYPE_CHECKING:
    from winding_cli.commands.wanted_lay import Held
    from winding_reports.records.identity import Origin


def write_recorded_report(
    source: Path, out: Path, held: Held, error_limit_pct: float, *, errors_held: bool
) -> None:
    """Write index.html and run.json of a recording into a folder, and print what they say.

    Args:
        source: The recording.
        out: New folder.
        held: What a lay that was driven is held against.
        error_limit_pct: What the errors of the lengths are held against [%].
        errors_held: Whether the command fails where they do not keep it.

    Raises:
        BagError: The recording cannot be read, or does not say what was wound.
    """
    from winding_core.condition import Condition
    from winding_core.lay_wish import LayWish
    from winding_recorder.bags.contents import configuration_of
    from winding_recorder.playback.recorded_buffer import recorded_run
    from winding_ros import topics
    from winding_supervisor.run_result import RunResult

    run = recorded_run(source)
    condition = configuration_of(Condition, run.parameters[topics.FEM], topics.FEM)
    wish = _of(LayWish, run.parameters.get(topics.LAY_CONTROL, {}))
    result = RunResult(
        buffer=run.buffer,
        wall_s=0.0,
        ended=run.ended,
        simulated=topics.RIG in run.parameters,
        bags=(source,),
    )
    numbers = out / "run.json"
    record, page = deliver(
        condition,
        result,
        out,
        numbers,
        wish,
        held.limit,
        origin=_origin(run.origin),
        seed=seed_of(run.parameters),
        error_limit_pct=error_limit_pct,
    )
    show(record, page, numbers, (source,), None)
    refuse_flawed(record, result, held=held.asked, errors_held=errors_held)


def _origin(text: str) -> Origin | None:
    """Return which run a recording is of; None where it does not say so."""
    from winding_reports.records.identity import Origin

    try:
        return Origin.from_text(text) if text else None
    except ValueError:
        return None


def _of(record: type, values: Mapping[str, Any]) -> dict[str, Any]:
    names = {item.name for item in fields(record)}
    return {name: value for name, value in values.items() if name in names}
