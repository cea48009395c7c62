"""What is left of a finished run: its numbers, its report, its trace, and where they are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import staged
from winding_core.condition import Condition

if TYPE_CHECKING:
    from winding_study.runs.run_record import RunRecord
    from winding_supervisor.run import RunResult


def deliver(
    condition: Condition, result: RunResult, report: Path, json: Path
) -> tuple[RunRecord, Path]:
    """Write the run's numbers and its report; return its record and the report's page."""
    from winding_cli.output.results import run_record
    from winding_study.reports.report import write_report
    from winding_study.runs.run_record import write_run_json

    record = run_record(condition, result)
    with staged(json) as place:
        write_run_json(record, place)
    with staged(report) as place:
        page = report / write_report(record, place).name
    return record, page


def write_trace(record: RunRecord, result: RunResult, path: Path) -> None:
    """Write where the time of each corrected length went, for a viewer of Chrome's traces."""
    from winding_study.trace.chrome import write_chrome_trace

    assert record.trace is not None
    assert result.trace is not None
    with staged(path) as place:
        write_chrome_trace(record.trace, result.trace, place)


def show(
    record: RunRecord, page: Path, json: Path, bags: tuple[Path, ...], trace: Path | None
) -> None:
    """Print the results of a run and where its files are."""
    from winding_cli.output.results import results_table, trace_tables

    console = result_console()
    console.print(results_table(record))
    if record.trace is not None:
        console.print(*trace_tables(record.trace))
    further = [("bag", bag) for bag in bags] + ([] if trace is None else [("trace", trace)])
    for name, path in (("report", page), ("numbers", json), *further):
        console.print(f"{name}: {path}", soft_wrap=True)
