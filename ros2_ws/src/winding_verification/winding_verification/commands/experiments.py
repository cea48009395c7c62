"""Other people's experiments as a table: `winding verify --external FOLDER`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import MofNCompleteColumn, TimeElapsedColumn
from rich.table import Table

from winding_cli.terminal.console import progress_bar, result_console
from winding_cli.terminal.refusal import refuse

if TYPE_CHECKING:
    from winding_verification.experiments.external_row import ExternalRow


def announce_compilation() -> None:
    """Say on stderr if the kernels have to be compiled first."""
    from cable_fem_node.dynamics.compile import is_compiled

    if not is_compiled():
        Console(stderr=True).print(
            "compiling the solver's kernels: once after installation, a minute at most"
        )


def compare_external(folder: Path, names: list[str]) -> list[ExternalRow]:
    """Compute the experiments in a folder, print them beside what others published.

    Args:
        folder: Somewhere above their files.
        names: Of experiments; all if there are none.
    """
    from cable_fem_node.dynamics.failure import SolverError
    from winding_verification.experiments.sources import NAMES, found_work

    unknown = [name for name in names if name not in NAMES]
    if unknown:
        refuse(f"no experiment named {', '.join(unknown)}; there are {', '.join(NAMES)}")
    rows: list[ExternalRow] = []
    try:
        found, others = found_work(folder, names or NAMES)
        announce_compilation()
        with progress_bar(MofNCompleteColumn(), TimeElapsedColumn()) as bar:
            task = bar.add_task("computing", total=len(found))
            for work in found:
                bar.update(task, description=f"computing {work.name}")
                rows += work.rows()
                bar.update(task, advance=1)
    except (ValueError, SolverError) as error:
        refuse(error)
    console = result_console()
    console.print(_table(rows))
    judged = [row for row in rows if row.bar is not None]
    kept = sum(row.passed for row in judged)
    console.print(f"{kept} of {len(judged)} quantities within their bar")
    if others:
        console.print(f"not compared: {', '.join(others)}", highlight=False)
    return rows


def external_record(row: ExternalRow) -> dict[str, Any]:
    """Return a row for JSON."""
    return {
        "experiment": row.experiment,
        "variant": row.variant,
        "quantity": row.quantity,
        "computed": row.computed,
        "bar": row.bar,
        "bar_is": "least" if row.at_least else "most",
        "published": dict(row.published),
        "pass": row.passed,
    }


def _table(rows: list[ExternalRow]) -> Table:
    solvers = sorted({solver for row in rows for solver in row.published})
    table = Table(title="Other people's experiments")
    for column in ("experiment", "variant", "quantity"):
        table.add_column(column)
    for column in (*(f"published: {solver}" for solver in solvers), "here", "bar", "pass"):
        table.add_column(column, justify="right")
    titled = ""
    for row in rows:
        if row.experiment != titled:
            titled = row.experiment
            table.add_section()
        table.add_row(
            row.experiment,
            row.variant,
            row.quantity,
            *(_short(row.published.get(solver)) for solver in solvers),
            _short(row.computed),
            "" if row.bar is None else f"{'>=' if row.at_least else '<='} {row.bar:.2g}",
            "" if row.bar is None else "yes" if row.passed else "[red]NO[/red]",
        )
    return table


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
