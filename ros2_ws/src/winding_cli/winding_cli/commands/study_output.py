"""What a study prints and writes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import staged, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from winding_reports.documents.data_table import DataTable
    from winding_reports.records.identity import Identity
    from winding_study.paper.study_record import StudyRecord


def show(record: StudyRecord) -> None:
    """Print every cell, the means, the models and the verdict."""
    console = result_console()
    _print(console, record.cells_table())
    _print(console, record.means_table())
    for table in record.own_tables():
        _print(console, table)
    results = record.results
    if results:
        console.print(
            f"{sum(result.cpu_seconds for result in results):.1f} CPU seconds; energy balance open "
            f"by at most {max(result.energy_balance_pct for result in results):.2g} %; one guide "
            "distance and the dead weight for all cases, nothing fitted.",
            highlight=False,
        )
    console.print(record.verdict(), highlight=False)


def deliver(
    record: StudyRecord,
    *,
    stored: int,
    report: Path | None,
    json: Path | None,
    lengths: Path | None,
    seeds: tuple[int, ...],
) -> None:
    """Write the files that were asked for, and say so when one was there before.

    Args:
        record: What was found.
        stored: How many of its cases were in the store.
        report: Folder of the report; None for none.
        json: File of all numbers; None for none.
        lengths: File of the predicted lengths; None for none.
        seeds: Of the networks.
    """
    from correction_node.models.dataset import format_lengths
    from winding_cli.output.origin import origin_here
    from winding_study.paper.study import predicted_lengths
    from winding_study.paper.study_record import study_identity

    identity = study_identity(record, origin_here(), seeds)
    if json is not None:
        _announce(json)
        write_json(json, {"identity": identity.as_json(), **record.as_json()})
    if lengths is not None:
        _announce(lengths)
        with staged(lengths) as place:
            text = format_lengths(predicted_lengths(record.results))
            place.write_text(text, encoding="utf-8")
    if report is not None:
        _report(record, report, stored, identity)


def calibrate(law: str | None, json: Path | None) -> None:
    """Fit the rig's span tension and print it."""
    from dataclasses import asdict

    from rich.console import Console
    from rich.table import Table

    from winding_study.paper.calibration import LAW, calibrate

    console = result_console()
    with Console(stderr=True).status("fitting five numbers thirteen times"):
        fitted = calibrate(law or LAW)
    table = Table(title=f"Span tension of the rig, fitted with law {fitted.law}")
    for column in ("number", "value", "standard error"):
        table.add_column(column, justify="left" if column == "number" else "right")
    units = {"offset": " (F0), N", "diameter_gain": " (b), N", "build_up_length": " (L_c), m"}
    for (name, value), error in zip(
        asdict(fitted.tension).items(), fitted.standard_errors, strict=True
    ):
        label = name.replace("_", " ") + units.get(name, "")
        table.add_row(label, f"{value:.4f}", f"{error:.4f}")
    console.print(table)
    console.print(
        f"theta, relative rms over {len(fitted.residuals_pct)} measured markers: "
        f"{fitted.in_sample_rms_pct:.2f} % in-sample, "
        f"{fitted.leave_one_case_out_rms_pct:.2f} % leave-one-case-out. The form of the law was "
        "found on these very cells, so even the left-out number flatters it."
    )
    if json is not None:
        _announce(json)
        write_json(json, {"calibration": fitted.as_json()})


def _report(record: StudyRecord, folder: Path, stored: int, identity: Identity) -> None:
    from winding_study.paper.study_report import write_study

    _announce(folder / "index.html")
    with staged(folder) as place:
        page = write_study(record, place, stored=stored, identity=identity)
    print(f"Report: {folder / page.name}")


def _announce(path: Path) -> None:
    if path.exists():
        print(f"{path} was there and is replaced", file=sys.stderr)


def _print(console: Console, table: DataTable) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    means = table.mean_texts()
    shown = Table(title=table.title, box=box.SIMPLE_HEAD, show_footer=bool(means), padding=(0, 1))
    for index, (column, worded) in enumerate(zip(table.columns, table.worded, strict=True)):
        shown.add_column(
            Text(column.name.replace(": ", "\n")),
            means[index] if means else "",
            justify="left" if worded else "right",
        )
    for texts in table.texts():
        shown.add_row(*texts)
    console.print(shown)
