"""`winding verify`: the solver's verification suite, or published experiments, as a table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.progress import MofNCompleteColumn
from rich.table import Table

from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import Force, Json, check_output_file, write_json
from winding_cli.terminal.refusal import FAILED, refuse

if TYPE_CHECKING:
    from winding_verification.experiments.scenario import ExternalRow
    from winding_verification.solver.suite import Row

_Row = TypeVar("_Row")


def verify(
    problems: Annotated[
        list[str] | None,
        typer.Argument(help="Names of problems, e.g. B07 W04, or experiments; all by default."),
    ] = None,
    external: Annotated[
        Path | None,
        typer.Option(
            help="Other people's experiments instead: cosseratbench, DEFORM, a capstan's table."
        ),
    ] = None,
    json_file: Json = None,
    force: Force = False,
) -> None:
    """Compare the solver with closed forms and reference solutions; exit code 1 if one fails."""
    check_output_file(json_file, "--json", force=force)
    if external is None:
        passed, records = _verify_suite(problems or [])
    elif external.is_dir():
        passed, records = _compare_external(external, problems or [])
    else:
        refuse(f"--external: there is no folder {external}")
    write_json(json_file, records)
    if not passed:
        raise typer.Exit(FAILED)


def _verify_suite(problems: Sequence[str]) -> tuple[bool, list[dict[str, Any]]]:
    """Compute problems, all if none is named, and print them; return whether all pass, and rows."""
    from winding_verification.solver.suite import PROBLEMS, run_problem

    names = [name.upper().replace("R", "r") for name in problems] or list(PROBLEMS)
    unknown = [name for name in names if name not in PROBLEMS]
    if unknown:
        refuse(f"no problem named {', '.join(unknown)}; there are {', '.join(PROBLEMS)}")
    rows: list[Row] = []
    for found in _computed("verifying", [(name, partial(run_problem, name)) for name in names]):
        rows += found
    console = result_console()
    console.print(_suite_table(rows))
    kept = sum(row.passed for row in rows)
    console.print(f"{kept} of {len(rows)} quantities within their tolerance")
    return kept == len(rows), [row.record() for row in rows]


def _compare_external(folder: Path, names: Sequence[str]) -> tuple[bool, list[dict[str, Any]]]:
    """Compute experiments, all if none is named, beside published figures; return as above."""
    from cable_fem_node.dynamics.state import SolverError
    from winding_verification.experiments.comparison import NAMES, found_work

    unknown = [name for name in names if name not in NAMES]
    if unknown:
        refuse(f"no experiment named {', '.join(unknown)}; there are {', '.join(NAMES)}")
    rows: list[ExternalRow] = []
    try:
        work, others = found_work(folder, names or NAMES)
        for found in _computed("computing", work):
            rows += found
    except ValueError as error:
        refuse(error)
    except SolverError as error:
        refuse(error, FAILED)
    console = result_console()
    console.print(_external_table(rows))
    judged = [row for row in rows if row.bar is not None]
    kept = sum(row.passed for row in judged)
    console.print(f"{kept} of {len(judged)} quantities within their bar")
    if others:
        console.print(f"not compared: {', '.join(others)}")
    return kept == len(judged), [row.record() for row in rows]


def _computed(
    verb: str, work: Sequence[tuple[str, Callable[[], Iterable[_Row]]]]
) -> Iterator[Iterable[_Row]]:
    """Yield the rows of each named piece of work, under a bar of progress."""
    with busy(verb, MofNCompleteColumn(), total=len(work)) as show:
        for name, rows in work:
            show(description=f"{verb} {name}")
            yield rows()
            show(advance=1)


_SUITE = (
    Shown("problem", lambda _: ""),
    Shown("quantity", lambda row: f"{row.quantity} \\[{row.unit}]"),
    Shown("reference", lambda row: _figure(row.reference), ".6g"),
    Shown("computed", lambda row: _figure(row.computed), ".6g"),
    Shown("error", lambda row: row.error, ".2g", missing="nan"),
    Shown("tolerance", lambda row: f"{row.tolerance:.2g} {'rel' if row.relative else row.unit}"),
    Shown("pass", lambda row: _pass(row.passed)),
)


def _suite_table(rows: list[Row]) -> Table:
    table = record_table(_SUITE, (), words=2, title="Verification of the solver")
    for (problem, title), own in groupby(rows, key=attrgetter("problem", "title")):
        table.add_section()
        table.add_row(f"[bold]{problem}[/bold]", f"[bold]{title}[/bold]")
        for row in own:
            table.add_row(*(column.text(row) for column in _SUITE))
    return table


def _external_table(rows: list[ExternalRow]) -> Table:
    def published(solver: str) -> Shown:
        return Shown(
            f"published: {solver}", lambda row: row.published.get(solver), ".3g", missing=""
        )

    def bar(row: ExternalRow) -> str:
        sign = ">=" if row.at_least else "<="
        return "" if row.bar is None else f"{sign} {row.bar:.2g}"

    columns = (
        *(Shown(name, attrgetter(name)) for name in ("experiment", "variant", "quantity")),
        *map(published, sorted({solver for row in rows for solver in row.published})),
        Shown("here", lambda row: row.computed, ".3g", missing="nan"),
        Shown("bar", bar),
        Shown("pass", lambda row: "" if row.bar is None else _pass(row.passed)),
    )
    table = record_table(columns, (), words=3, title="Other people's experiments")
    for _, own in groupby(rows, key=attrgetter("experiment")):
        table.add_section()
        for row in own:
            table.add_row(*(column.text(row) for column in columns))
    return table


def _figure(value: Any) -> Any:
    return value if isinstance(value, int | float) else "array"


def _pass(passed: bool) -> str:
    return "yes" if passed else "[red]NO[/red]"
