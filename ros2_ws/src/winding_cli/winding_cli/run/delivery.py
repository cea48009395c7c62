"""What a run leaves is delivered: numbers, report, trace, tables; the flaw that fails a command."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from winding_cli.terminal.console import Shown, record_table, result_console
from winding_cli.terminal.output_path import STANDARD_OUTPUT, staging, write_json
from winding_cli.terminal.refusal import FAILED, complain, refuse
from winding_core.cable.condition import Condition
from winding_core.parameters import build, declared_in
from winding_core.run_outcome import RunOutcome
from winding_core.units import MILLIMETRE, MILLISECOND
from winding_reports.records.identity import Origin
from winding_reports.records.run_record import RunRecord, run_json, write_run_json
from winding_reports.trace import LengthTrace, hop_costs, write_chrome_trace

if TYPE_CHECKING:
    from winding_supervisor.session.run_config import RunConfig
    from winding_supervisor.session.session import RunResult

_RIG = "winding_rig"
_ORIGINS = {"camera": "exposure of the newest frame", "prediction": "encoder sample"}
_ROD = Shown("rod ahead\nmm", lambda row: row.s_rod, ".2f", MILLIMETRE)
_RESULTS = (
    Shown("marker", lambda row: f"P{row.id}"),
    Shown("original\nmm", lambda row: row.original, ".2f", MILLIMETRE),
    Shown("FEM\nmm", lambda row: row.s_fem, ".2f", MILLIMETRE),
    _ROD,
    Shown("tracked\nmm", lambda row: row.s_tracked, ".2f", MILLIMETRE),
    Shown("h\n", lambda row: row.h, ".4f"),
    Shown("corrected\nmm", lambda row: row.s_corrected, ".2f", MILLIMETRE),
    Shown("published\nmm", lambda row: row.s_published, ".2f", MILLIMETRE),
    Shown("error of\nFEM, %", lambda row: row.error_fem_pct, ".2f"),
    Shown("error after\ncorrection, %", lambda row: row.error_corrected_pct, ".2f"),
)
_HOPS = (
    Shown("where", lambda cost: cost.station),
    Shown("what", lambda cost: cost.name),
    Shown("median, ms", lambda cost: cost.median, ".2f", MILLISECOND),
    Shown("p99, ms", lambda cost: cost.p99, ".2f", MILLISECOND),
    Shown("share, %", lambda cost: cost.share, ".1f", 0.01),
)


class RunDelivery:
    """Delivers the runs of one command."""

    def __init__(self, config: RunConfig, origin: Origin) -> None:
        # What the newest run left; None before one was delivered.
        self.result: RunResult | None = None
        self.outcome: RunOutcome | None = None  # How it came out; None where nothing was wound
        self._config, self._spec = config, config.spec
        self._origin = origin
        self._operated = config.page is not None
        self.directory = config.directory  # The command's folder
        self._count = 0
        self._flaws: list[str] = []

    def begin(self, directory: Path) -> None:
        """Take the folder that was made for the command."""
        self.directory = directory

    def deliver(self, result: RunResult) -> RunOutcome | None:
        """Write and print what a run leaves; return how it came out, None where none was wound.

        A disk that takes no more ends no session: the operator winds on, and the command fails at
        its end.
        """
        from winding_cli.run.outcome import asked_extent
        from winding_cli.run.record import run_record
        from winding_cli.terminal.origin import origin_here

        self.result, self.outcome = result, None
        spec, machine = self._spec, self._config.machine
        condition = spec.condition
        # The condition of a machine with a driver of its own is the command line's in every run.
        chosen = self._operated and machine is None
        if chosen:
            if not result.wound or result.buffer.time <= 0.0:
                return None
            declared = declared_in(Condition, result.wound)
            condition = build(Condition, declared, owner="the run")
        self._count += 1
        parameters = self._config.parameters()
        if result.wound:
            parameters[_RIG] |= result.wound
        # The first run has the command's own folder.
        folder = self.directory / ("" if self._count == 1 else f"run-{self._count}")
        asked = asked_extent(condition, None if machine is None else machine.end_angle)
        if chosen:
            condition = replace(condition, duration=min(condition.duration, result.buffer.time))
        record = run_record(
            condition,
            result,
            spec.wish,
            result.limits or spec.limits,
            asked=asked,
            parameters=parameters,
            origin=replace(origin_here(result.began), labels=self._origin.labels)
            if self._operated
            else self._origin,
        )
        show(record)
        try:
            write(
                record,
                self._numbered("report") or folder / "report",
                self._numbered("json") or folder / "run.json",
                bags=result.bags,
                trace=self._numbered("trace"),
                result=result,
            )
        except OSError as error:
            self._rescue(record, error)
        found = flaw(record, result, spec.given)
        if found:
            self._flaws.append(found)
        self.outcome = record.outcome
        return record.outcome

    @property
    def flawed(self) -> bool:
        """Whether the command fails at its end."""
        return bool(self._flaws)

    def end(self) -> None:
        """End the command as its runs came out."""
        if self._operated and not self._count:
            print("the operator ended the run before anything was wound", flush=True)
        if self._flaws:
            refuse(self._flaws[-1], FAILED)

    def _rescue(self, record: RunRecord, error: OSError) -> None:
        """Write the numbers where there is room for them: the run's own place takes no more."""
        place = Path(tempfile.mkdtemp(prefix="winding-run-")) / "run.json"
        write_run_json(record, place)
        sentence = f"what run {self._count} left could not be written: {error}; numbers: {place}"
        complain(sentence)
        self._flaws.append(sentence)

    def _numbered(self, option: str) -> Path | None:
        """Return where the first run's file would be, or that of the present run beside it."""
        path = self._spec.path(option)
        if path is None or path == STANDARD_OUTPUT or self._count == 1:
            return path
        return path.with_name(f"{path.stem}-{self._count}{path.suffix}")


def write(
    record: RunRecord,
    report: Path,
    json: Path,
    *,
    bags: tuple[Path, ...],
    trace: Path | None = None,
    result: RunResult | None = None,
) -> None:
    """Write the numbers of a run, its report and its trace; print where they are.

    Args:
        record: Of the run.
        report: Folder of the report.
        json: File of the numbers, or standard output.
        bags: That were recorded.
        trace: File of the trace for a viewer of Chrome's traces; None for none.
        result: What the run left, for its trace.
    """
    from winding_reports.run_report.report import write_report

    if json == STANDARD_OUTPUT:
        write_json(json, run_json(record))
    else:
        with staging(json) as place:
            write_run_json(record, place)
    with staging(report) as place:
        page = report / write_report(record, place).name
    files = [("report", page), ("numbers", json), *(("bag", bag) for bag in bags)]
    if trace is not None and result is not None:
        assert record.trace is not None
        assert result.trace is not None
        with staging(trace) as place:
            write_chrome_trace(record.trace, result.trace, place)
        files.append(("trace", trace))
    for name, path in files:
        result_console().print(f"{name}: {path}", soft_wrap=True)


def show(record: RunRecord) -> None:
    """Print the results of a run and how it came out."""
    console = result_console()
    console.print(results_table(record))
    for sentence in record.outcome.sentences:
        console.print(sentence, soft_wrap=True)
    if record.trace is not None:
        console.print(*trace_tables(record.trace))


def flaw(record: RunRecord, result: RunResult, given: Collection[str]) -> str:
    """Return why the command fails although its run was delivered; empty for no reason.

    Args:
        record: Of the run.
        result: What it left.
        given: Options that the user gave. A lay that was driven must be known to keep a tolerance
            of these, and the errors of the lengths a limit.
    """
    if record.outcome.failed:
        return record.outcome.ending.danger or record.outcome.headline
    if result.losses:
        return result.losses[0]
    lay = record.lay
    if "lay_tolerance_mm" in given and lay is not None and lay.drove and not lay.verdict.kept:
        return lay.verdict.sentence
    if "error_limit_pct" in given and not record.verdict.good:
        return record.verdict.sentence
    return ""


def results_table(record: RunRecord) -> Table:
    """Return every marker of a run: original, predicted, tracked, corrected, published, errors."""
    name = f"case {record.case.number}" if record.case.number else "an own condition"
    columns = tuple(column for column in _RESULTS if column is not _ROD or record.element != "rod")
    return _table(columns, record.rows, 1, f"Curve lengths of {name}")


def trace_tables(trace: LengthTrace) -> list[Table]:
    """Return what each hop of the ways to the corrected lengths takes."""
    return [
        _table(
            _HOPS,
            hop_costs(way),
            2,
            f"From the {_ORIGINS[way.name]} to the corrected length, {len(way.stamps)} of "
            f"{trace.lengths} lengths",
        )
        for way in trace.ways
    ]


def _table(columns: tuple[Shown, ...], rows: Iterable[Any], words: int, title: str) -> Table:
    return record_table(
        columns, rows, words=words, title=title, box=SIMPLE_HEAD, title_justify="left"
    )
