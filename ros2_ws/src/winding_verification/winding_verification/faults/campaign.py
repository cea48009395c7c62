"""Every row of the fault table, one after the other, as `winding faults` tries them."""

from __future__ import annotations

import dataclasses
from collections.abc import Awaitable, Callable, Set
from pathlib import Path

from rich.console import Console
from rich.table import Table

from winding_ros.graph import GraphError
from winding_verification.faults.cell import CellError, FaultCell
from winding_verification.faults.outcome import STAND_WITHIN, Outcome, ProcessorWatch
from winding_verification.faults.table import LONE_ROWS, ROWS

NAMESPACE = "faults"


def row_names() -> list[str]:
    """Return the names of all rows in their order."""
    return [row.name for row in ROWS] + [row.name for row in LONE_ROWS]


async def watched(trial: Awaitable[Outcome]) -> Outcome:
    """Return a trial's outcome with how busy the computer was meanwhile."""
    watch = ProcessorWatch()
    outcome = await trial
    return dataclasses.replace(outcome, load=watch.load(), idle=watch.idle())


async def try_rows(names: Set[str], folder: Path, tell: Callable[[Outcome], None]) -> list[Outcome]:
    """Try rows on one graph, then those that need a run of their own.

    Args:
        names: Of the rows.
        folder: Existing folder for logs and runs.
        tell: Receives each outcome as soon as it is known.
    """
    outcomes: list[Outcome] = []

    async def attempt(name: str, trial: Awaitable[Outcome]) -> None:
        try:
            outcomes.append(await watched(trial))
        except (CellError, GraphError, TimeoutError) as error:
            outcomes.append(Outcome(fault=name, outcome=str(error), survived=False))
        tell(outcomes[-1])

    rows = [row for row in ROWS if row.name in names]
    if rows:
        async with FaultCell(folder / "cell", NAMESPACE).running() as cell:
            for number, row in enumerate(rows):
                await attempt(row.name, row.try_it(cell, folder / f"row{number}"))
    for lone in LONE_ROWS:
        if lone.name in names:
            await attempt(lone.name, lone.try_it(folder / lone.name.replace(" ", "-")))
    return outcomes


def show(outcomes: list[Outcome], console: Console) -> None:
    """Print the table, and what the computer could do meanwhile."""
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
            outcome.verdict,
        )
    console.print(table)
    passed = sum(outcome.passed for outcome in outcomes)
    console.print(f"{passed} of {len(outcomes)} faults survived as they have to be")
    busy = [outcome for outcome in outcomes if outcome.saturated]
    if busy:
        load, idle = max(row.load for row in busy), min(row.idle for row in busy)
        console.print(
            f"The computer was saturated during {len(busy)} of them: up to {load:.1f} processes "
            f"for each processor, {idle:.0%} of processor time idle. Their seconds are printed "
            "and not judged."
        )
    else:
        console.print("The computer was not saturated: the seconds were judged too.")


def _timed(seconds: float | None, bar: float) -> tuple[str, str]:
    if seconds is None:
        return "-", ""
    return f"{seconds:.3f}", f"{bar:g}"
