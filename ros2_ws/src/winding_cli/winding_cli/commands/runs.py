"""`winding runs`: list, show and compare the runs of a folder, and report what drifts over them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from winding_cli.app import command_group
from winding_cli.terminal.console import Shown, record_table, result_console, six_digits
from winding_cli.terminal.output_path import (
    Force,
    Json,
    by_suffix,
    check_output_file,
    staged,
    write_json,
    write_text,
)
from winding_cli.terminal.record_options import Typed, with_declared
from winding_cli.terminal.refusal import need_extra, refuse, refused
from winding_core.units import MEGAPASCAL, MILLIMETRE
from winding_reports.runs.run_index import NUMBERS, RunIndex, RunIndexError, Selection
from winding_reports.runs.run_row import VERDICTS, RunRow, compared, row_of_file

if TYPE_CHECKING:
    from winding_reports.documents.data_table import DataTable

runs = command_group(__doc__)
Folder = Annotated[Path, typer.Argument(help="Folder of runs, with folders in it.")]
In = Annotated[Path, typer.Option("--folder", help="Folder of runs, in which ids are looked up.")]
Run = Annotated[str, typer.Argument(help="Folder of a run, its run.json, or a run's id.")]
_SENTENCES = 12  # Announcements that a terminal shows
# A date of ISO 8601, or the beginning of one.
_DATE = re.compile(r"\d{4}(-\d\d(-\d\d(T\d\d(:\d\d(:\d\dZ?)?)?)?)?)?")
_SELECTED = {
    "cable": Annotated[str | None, typer.Option(help="Only runs of this cable.")],
    "machine": Annotated[str | None, typer.Option(help="Only runs of this machine.")],
    "batch": Annotated[str | None, typer.Option(help="Only runs of this batch.")],
    "operator": Annotated[str | None, typer.Option(help="Only runs of this operator.")],
    "remark": Annotated[str | None, typer.Option(help="Only runs whose remark has this in it.")],
    "verdict": Annotated[
        str | None, typer.Option(help=f"Only runs that are: {', '.join(VERDICTS)}.")
    ],
    "since": Annotated[str | None, typer.Option(help="Only runs from this date on: 2026-11-05.")],
    "until": Annotated[str | None, typer.Option(help="Only runs up to this date.")],
}
_LISTED = (
    Shown("date", lambda row: row.date or "-"),
    Shown("run", lambda row: row.path),
    Shown("verdict", lambda row: row.verdict),
    Shown("cable", lambda row: row.cable or "-"),
    Shown("machine", lambda row: row.machine or "-"),
    Shown("batch", lambda row: row.batch or "-"),
    Shown("operator", lambda row: row.operator or "-"),
    Shown("error, %", lambda row: row.error_pct, ".2f"),
    Shown("E, MPa", lambda row: row.young_pa, ".4g", MEGAPASCAL),
    Shown("lay, mm", lambda row: row.lay_error_m, ".2f", MILLIMETRE),
    Shown("reason or remark", lambda row: "; ".join(filter(None, (row.reason, row.remark)))),
)


@runs.command(name="list")
@with_declared(_SELECTED)
def list_runs(
    selected: Typed,
    *,
    folder: Folder = Path("runs"),
    newest: Annotated[
        int, typer.Option(min=1, help="So many of the newest are shown; files have all.")
    ] = 30,
    json_file: Json = None,
    output: Annotated[
        list[Path] | None, typer.Option(help="Table of all of them, .csv or .parquet; repeatable.")
    ] = None,
    force: Force = False,
) -> None:
    """List runs with their verdicts, and why one is not good."""
    files = _checked(output, {".csv": None, ".parquet": None, ".json": json_file}, force=force)
    selection = _selection(selected)
    with refused(RunIndexError), RunIndex(folder) as index:
        counts = index.counts(selection)
        whole = any(files)
        rows = index.rows(selection, None if whole else newest)
    console = result_console()
    console.print(record_table(_LISTED, rows[-newest:], words=7))
    total = sum(counts.values())
    found = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    shown = f"; the newest {newest} are shown" if total > newest else ""
    noun = "run" if total == 1 else "runs"
    console.print(f"{total} {noun}: {found or 'none'}{shown}")
    _write(files, lambda: {"counts": counts, "runs": [row._asdict() for row in rows]}, rows)


@runs.command()
def show(run: Run, folder: In = Path("runs"), json_file: Json = None, force: Force = False) -> None:
    """Show a run: verdict, reason, labels and numbers."""
    check_output_file(json_file, "--json", force=force)
    with refused(RunIndexError):
        file = _file(run, folder)
    row = row_of_file(str(file.parent), file)
    console = result_console()
    pairs = [(name, value) for name, value in row._asdict().items() if value is not None]
    value = Shown("value", lambda pair: six_digits(pair[1]))
    columns = (Shown("what", lambda pair: pair[0]), value)
    console.print(record_table(columns, pairs, words=2))
    write_json(json_file, {"counts": {row.verdict: 1}, "runs": [row._asdict()]})


@runs.command()
def compare(
    first: Run, second: Run, folder: In = Path("runs"), json_file: Json = None, force: Force = False
) -> None:
    """Show two runs side by side: what differs in condition, outcome and numbers."""
    check_output_file(json_file, "--json", force=force)
    with refused(ValueError):
        record = compared(*(_file(name, folder) for name in (first, second)))
    columns = (
        Shown("what", "name"),
        Shown(first, lambda item: six_digits(item["first"])),
        Shown(second, lambda item: six_digits(item["second"])),
        Shown("difference", lambda item: six_digits(item["difference"])),
    )
    result_console().print(record_table(columns, record["rows"], words=3))
    write_json(json_file, record)


@runs.command()
@with_declared(_SELECTED)
def trend(
    selected: Typed,
    *,
    folder: Folder = Path("runs"),
    json_file: Json = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(help="Page .html, or every point in .csv or .parquet; repeatable."),
    ] = None,
    force: Force = False,
) -> None:
    """Report what drifts over runs, from control charts of every cable on every machine."""
    from winding_reports.runs.trend import announcements, points_table, trend_json, trends

    given = {".csv": None, ".parquet": None, ".json": json_file, ".html": None}
    *files, page = _checked(output, given, force=force)
    selection = _selection(selected)
    with refused(RunIndexError), RunIndex(folder) as index:
        rows, counts = index.rows(selection), index.counts(selection)
    found = trends(rows)
    console = result_console()
    sentences = announcements(found)
    for sentence in sentences[:_SENTENCES]:
        console.print(f"{sentence}.", soft_wrap=True)
    if len(sentences) > _SENTENCES:
        console.print(f"and {len(sentences) - _SENTENCES} before; --json has all of them")
    drifting = sum(bool(item.chart.drifts) for item in found)
    none = "" if found else "; a chart needs five whole runs of one cable, machine and condition"
    console.print(f"{len(rows)} runs, {len(found)} charts, {drifting} with a drift{none}")
    _write(files, lambda: trend_json(found, len(rows)), lambda: points_table(found))
    if page is not None:
        from winding_reports.runs.trend_page import render_trend

        write_text(page, render_trend(str(folder), rows, counts, found))


def _checked(
    output: list[Path] | None, given: Mapping[str, Path | None], *, force: bool
) -> list[Path | None]:
    files = by_suffix(output or (), given)
    for option, path in zip(given, files, strict=True):
        check_output_file(path, "--json" if option == ".json" else "--output", force=force)
        if option == ".parquet" and path is not None:
            need_extra("tables", "a table in Parquet")
    return files


def _selection(selected: Typed) -> Selection:
    wanted: dict[str, Any] = dict(selected)
    verdict = wanted.get("verdict", "")
    if verdict and verdict not in VERDICTS:
        refuse(f"--verdict must be one of {', '.join(VERDICTS)}, got {verdict!r}")
    for name in ("since", "until"):
        if not _DATE.fullmatch(wanted.get(name, "2026")):
            refuse(f"--{name} must begin like 2026-11-05, got {wanted[name]!r}")
    return Selection(**wanted)


def _write(
    files: list[Path | None],
    record: Callable[[], object],
    rows: list[RunRow] | Callable[[], DataTable],
) -> None:
    """Write a table as CSV and Parquet and a record as JSON, where they are wanted."""
    from winding_reports.documents.data_table import Column, DataTable

    csv_file, parquet_file, json_file = files
    if json_file is not None:
        write_json(json_file, record())
    if not (csv_file or parquet_file):
        return
    if callable(rows):
        table = rows()
    else:
        columns = tuple(Column(name=name) for name in RunRow._fields)
        table = DataTable(name="runs", title="Runs", columns=columns, rows=tuple(rows))
    if csv_file is not None:
        write_text(csv_file, table.as_csv())
    if parquet_file is not None:
        with staged(parquet_file) as place:
            table.write_parquet(place)


def _file(name: str, folder: Path) -> Path:
    """Return the file of a run's numbers.

    Raises:
        RunIndexError: There is no such run.
    """
    for path in (Path(name), Path(name) / NUMBERS):
        if path.is_file():
            return path
    with RunIndex(folder) as index:
        return folder / index.run(name).path / NUMBERS
