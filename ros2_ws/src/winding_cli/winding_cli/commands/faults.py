"""`winding faults`: put every fault of the table into real processes and measure what happens."""

from __future__ import annotations

import asyncio
import json as json_format
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.commands.console import result_console
from winding_cli.commands.refusal import FAILED, refuse

if TYPE_CHECKING:
    from fault_table.outcome import Outcome
    from rich.console import Console

_NAMESPACE = "faults"


def faults(
    json: Annotated[Path | None, typer.Option(help="Also write the table to this file.")] = None,
    only: Annotated[
        str | None, typer.Option(help="Try only the rows whose name contains this text.")
    ] = None,
    domain: Annotated[
        int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")
    ] = None,
) -> None:
    """Kill, hold and mislead a running graph in every way of the table; exit 1 if it fails one."""
    from fault_table.table import LONE_ROWS, ROWS

    from winding_ros.environment import set_process_environment
    from winding_supervisor.domain_lock import DomainError, chosen_domain, domain_lock

    known = [row.name for row in ROWS] + [row.name for row in LONE_ROWS]
    names = [name for name in known if (only or "") in name]
    if not names:
        refuse(f"no row of the fault table contains {only!r}")
    console = result_console()
    try:
        chosen = chosen_domain(domain)
        with (
            domain_lock(chosen, _NAMESPACE),
            tempfile.TemporaryDirectory(prefix="winding-faults-") as folder,
        ):
            set_process_environment(chosen, Path(folder) / "log")
            outcomes = asyncio.run(_try_all(set(names), Path(folder)))
    except DomainError as error:
        refuse(error)
    _show(outcomes, console)
    if json is not None:
        records = [outcome.as_record() for outcome in outcomes]
        json.write_text(json_format.dumps(records, indent=1) + "\n", encoding="utf-8")
    if not all(outcome.passed for outcome in outcomes):
        raise typer.Exit(FAILED)


async def _try_all(names: set[str], folder: Path) -> list[Outcome]:
    from fault_table.cell import CellError, FaultCell
    from fault_table.outcome import Outcome
    from fault_table.table import LONE_ROWS, ROWS

    from winding_supervisor.graph_error import GraphError

    outcomes: list[Outcome] = []

    def failed(name: str, error: Exception) -> None:
        outcomes.append(Outcome(fault=name, outcome=str(error), survived=False))

    def told() -> None:
        done = outcomes[-1]
        print(f"{'ok    ' if done.passed else 'FAILED'}  {done.fault}", file=sys.stderr, flush=True)

    rows = [row for row in ROWS if row.name in names]
    if rows:
        async with FaultCell(folder / "cell", _NAMESPACE).running() as cell:
            for number, row in enumerate(rows):
                try:
                    outcomes.append(await row.try_it(cell, folder / f"row{number}"))
                except (CellError, GraphError, TimeoutError) as error:
                    failed(row.name, error)
                told()
    for lone in LONE_ROWS:
        if lone.name in names:
            try:
                outcomes.append(await lone.try_it(folder / lone.name.replace(" ", "-")))
            except (CellError, TimeoutError) as error:
                failed(lone.name, error)
            told()
    return outcomes


def _show(outcomes: list[Outcome], console: Console) -> None:
    from fault_table.outcome import STAND_WITHIN
    from rich.table import Table

    table = Table("fault", "at s", "detected by", "after s", "bar", "standstill s", "bar")
    for name in ("outcome", "survived"):
        table.add_column(name)
    for outcome in outcomes:
        table.add_row(
            outcome.fault,
            f"{outcome.injected_at:.2f}",
            outcome.detected_by,
            *_timed(outcome.detected_after, outcome.detect_within),
            *_timed(outcome.stood_after, STAND_WITHIN),
            outcome.outcome,
            "yes" if outcome.passed else "too late" if outcome.survived else "NO",
        )
    console.print(table)
    passed = sum(outcome.passed for outcome in outcomes)
    console.print(f"{passed} of {len(outcomes)} faults survived as they have to be")
    load = max(outcome.load for outcome in outcomes)
    if load > 1.0:
        console.print(
            f"The machine was busy: up to {load:.1f} processes for each processor. The bars hold "
            "for an idle one and were stretched by as much."
        )


def _timed(seconds: float | None, bar: float) -> tuple[str, str]:
    if seconds is None:
        return "-", ""
    return f"{seconds:.3f}", f"{bar:g}"
