"""What a run prints in the end: its markers, and where the time of their lengths went."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.table import Table

from winding_reports.records.run_record import RunRecord
from winding_reports.trace import LengthTrace, hop_costs

_ORIGINS = {"camera": "exposure of the newest frame", "prediction": "encoder sample"}


def results_table(record: RunRecord) -> Table:
    """Return every marker of a run: original, predicted, tracked, corrected, published, errors."""
    name = f"case {record.case.number}" if record.case.number else "an own condition"
    table = Table(title=f"Curve lengths of {name}", box=SIMPLE_HEAD, title_justify="left")
    table.add_column("marker")
    for heading in (
        "original\nmm",
        "FEM\nmm",
        "tracked\nmm",
        "h\n",
        "corrected\nmm",
        "published\nmm",
        "error of\nFEM, %",
        "error after\ncorrection, %",
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in record.rows:
        table.add_row(
            f"P{row.id}",
            *(_cell(value, 1e3, 2) for value in (row.original, row.s_fem, row.s_tracked)),
            _cell(row.h, 1.0, 4),
            *(_cell(value, 1e3, 2) for value in (row.s_corrected, row.s_published)),
            *(_cell(value, 1.0, 2) for value in (row.error_fem_pct, row.error_corrected_pct)),
        )
    return table


def trace_tables(trace: LengthTrace) -> list[Table]:
    """Return what each hop of the ways to the corrected lengths takes."""
    tables = []
    for way in trace.ways:
        table = Table(
            title=f"From the {_ORIGINS[way.name]} to the corrected length, {len(way.stamps)} of "
            f"{trace.lengths} lengths",
            box=SIMPLE_HEAD,
            title_justify="left",
        )
        for heading in ("where", "what"):
            table.add_column(heading)
        for heading in ("median, ms", "p99, ms", "share, %"):
            table.add_column(heading, justify="right", no_wrap=True)
        for cost in hop_costs(way):
            table.add_row(
                cost.station,
                cost.name,
                _cell(cost.median, 1e3, 2),
                _cell(cost.p99, 1e3, 2),
                _cell(cost.share, 1e2, 1),
            )
        tables.append(table)
    return tables


def _cell(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else f"{value * factor:.{digits}f}"
