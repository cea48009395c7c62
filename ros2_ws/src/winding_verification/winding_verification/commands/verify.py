"""`winding verify`: the solver's verification suite as a table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import MofNCompleteColumn, TimeElapsedColumn
from rich.table import Table

from winding_cli.terminal.console import progress_bar, result_console
from winding_cli.terminal.output_path import check_output_file, write_json
from winding_cli.terminal.refusal import FAILED, refuse
from winding_verification.commands.experiments import (
    announce_compilation,
    compare_external,
    external_record,
)

if TYPE_CHECKING:
    from winding_verification.solver.suite import Row


def verify(
    problems: Annotated[
        list[str] | None,
        typer.Argument(help="Names of problems, e.g. B07 W04, or experiments; all by default."),
    ] = None,
    external: Annotated[
        Path | None,
        typer.Option(
            help="Other people's experiments instead: cosseratbench, DEFORM, a capstan's table.",
        ),
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the rows to this file.")
    ] = None,
) -> None:
    """Compare the solver with closed forms and reference solutions; exit code 1 if one fails."""
    from winding_verification.solver.suite import PROBLEMS, run_suite

    check_output_file(json_file, "--json")
    if external is not None and not external.is_dir():
        refuse(f"--external: there is no folder {external}")
    if external is not None:
        rows = compare_external(external, problems or [])
        if json_file is not None:
            write_json(json_file, [external_record(row) for row in rows])
        if not all(row.passed for row in rows):
            raise typer.Exit(FAILED)
        return
    names = (
        list(PROBLEMS) if not problems else [name.upper().replace("R", "r") for name in problems]
    )
    unknown = [name for name in names if name not in PROBLEMS]
    if unknown:
        refuse(f"no problem named {', '.join(unknown)}; there are {', '.join(PROBLEMS)}")
    announce_compilation()
    own: list[Row] = []
    with progress_bar(MofNCompleteColumn(), TimeElapsedColumn()) as bar:
        task = bar.add_task("verifying", total=len(names))
        for name, found in run_suite(names):
            own += found
            bar.update(task, advance=1, description=f"verified {name}")
    console = result_console()
    console.print(_table(own))
    failed = [row for row in own if not row.passed]
    console.print(f"{len(own) - len(failed)} of {len(own)} quantities within their tolerance")
    if json_file is not None:
        write_json(json_file, [_record(row) for row in own])
    if failed:
        raise typer.Exit(FAILED)


def _table(rows: list[Row]) -> Table:
    table = Table(title="Verification of the solver")
    for column in ("problem", "quantity"):
        table.add_column(column)
    for column in ("reference", "computed", "error", "tolerance", "pass"):
        table.add_column(column, justify="right")
    titled = ""
    for row in rows:
        if row.problem != titled:
            titled = row.problem
            table.add_section()
            table.add_row(f"[bold]{row.problem}[/bold]", f"[bold]{row.title}[/bold]")
        sign = "rel" if row.relative else row.unit
        table.add_row(
            "",
            f"{row.quantity} \\[{row.unit}]",
            _short(row.reference),
            _short(row.computed),
            f"{row.error:.2g}",
            f"{row.tolerance:.2g} {sign}",
            "yes" if row.passed else "[red]NO[/red]",
        )
    return table


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, int | float) else "array"


def _record(row: Row) -> dict[str, Any]:
    return {
        "problem": row.problem,
        "title": row.title,
        "quantity": row.quantity,
        "unit": row.unit,
        "reference": row.reference,
        "computed": row.computed,
        "error": row.error,
        "tolerance": row.tolerance,
        "tolerance_kind": "relative" if row.relative else "absolute",
        "pass": row.passed,
    }
