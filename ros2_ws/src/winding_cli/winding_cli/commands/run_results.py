"""What is left of a finished run: its numbers, its report, its trace, and where they are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import staged
from winding_cli.commands.refusal import FAILED, refuse
from winding_core.condition import Condition
from winding_core.parameters import Value

if TYPE_CHECKING:
    from winding_reports.records.identity import Origin
    from winding_reports.records.run_record import RunRecord
    from winding_supervisor.run_result import RunResult


def deliver(
    condition: Condition,
    result: RunResult,
    report: Path,
    json: Path,
    wish: Mapping[str, Value],
    tolerance: float,
    *,
    origin: Origin | None,
    seed: int | None,
    error_limit_pct: float,
) -> tuple[RunRecord, Path]:
    """Write the run's numbers and its report; return its record and the report's page.

    Args:
        condition: What was wound.
        result: What the run left.
        report: Folder of the report.
        json: File of the numbers.
        wish: Parameters of the wanted lay, if there was one.
        tolerance: Of that lay, in every turn after the second [m].
        origin: The process that made the run; None where a recording does not say.
        seed: Of the simulated sensors; None for a real machine.
        error_limit_pct: Largest error of a corrected length that counts as good [%].
    """
    from winding_cli.output.results import run_record
    from winding_reports.records.run_record import write_run_json
    from winding_reports.run_report.report import write_report

    record = run_record(
        condition,
        result,
        wish,
        tolerance,
        origin=origin,
        seed=seed,
        error_limit_pct=error_limit_pct,
    )
    with staged(json) as place:
        write_run_json(record, place)
    with staged(report) as place:
        page = report / write_report(record, place).name
    return record, page


def write_trace(record: RunRecord, result: RunResult, path: Path) -> None:
    """Write where the time of each corrected length went, for a viewer of Chrome's traces."""
    from winding_reports.trace import write_chrome_trace

    assert record.trace is not None
    assert result.trace is not None
    with staged(path) as place:
        write_chrome_trace(record.trace, result.trace, place)


def show(
    record: RunRecord, page: Path, json: Path, bags: tuple[Path, ...], trace: Path | None
) -> None:
    """Print the results of a run and where its files are."""
    from winding_cli.output.result_tables import results_table, trace_tables

    console = result_console()
    console.print(results_table(record))
    verdict = record.verdict
    for sentence in filter(None, (verdict.sentence, verdict.held_out_sentence)):
        console.print(sentence, highlight=False, soft_wrap=True)
    if record.lay is not None:
        console.print(f"lay: {record.lay.verdict.sentence}", highlight=False, soft_wrap=True)
    if record.trace is not None:
        console.print(*trace_tables(record.trace))
    further = [("bag", bag) for bag in bags] + ([] if trace is None else [("trace", trace)])
    for name, path in (("report", page), ("numbers", json), *further):
        console.print(f"{name}: {path}", soft_wrap=True)


def seed_of(parameters: Mapping[str, Mapping[str, object]]) -> int | None:
    """Return the seed of the simulated sensors; None for a real machine.

    Args:
        parameters: By node.
    """
    from winding_core.parameters import declarations
    from winding_ros import topics
    from winding_ros.graph import RIG, parameters_of

    if topics.RIG not in parameters:
        return None
    own = {item.name: item.default for item in declarations(parameters_of(RIG))}
    seed = (own | dict(parameters[topics.RIG]))["seed"]
    assert isinstance(seed, int)
    return seed


def flaw(record: RunRecord, result: RunResult, *, held: bool, errors_held: bool = False) -> str:
    """Return the flaw of a run that came to its end; empty for none.

    Args:
        record: Of the run.
        result: What it left.
        held: Whether the user gave a tolerance, which a lay that was driven must then be known
            to keep.
        errors_held: Whether the user gave a limit of the errors, which they must then be known to
            keep.
    """
    if result.recording_error is not None:
        return f"the recording is incomplete: {result.recording_error}"
    lay = record.lay
    if held and lay is not None and lay.drove and not lay.verdict.kept:
        return lay.verdict.sentence
    if errors_held and not record.verdict.good:
        return record.verdict.sentence
    return ""


def refuse_flawed(
    record: RunRecord, result: RunResult, *, held: bool, errors_held: bool = False
) -> None:
    """End a command whose run has a flaw, as `flaw` finds it."""
    sentence = flaw(record, result, held=held, errors_held=errors_held)
    if sentence:
        refuse(sentence, FAILED)
