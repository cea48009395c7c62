"""Every row of the fault table, one after the other, as `winding faults` tries them."""

from __future__ import annotations

import dataclasses
import os
import signal
from collections.abc import Awaitable, Callable, Set
from functools import partial
from pathlib import Path

import psutil  # type: ignore[import-untyped]
from rich.console import Console
from rich.table import Table

from winding_ros import topics
from winding_ros.graph import GRAPH, GraphError
from winding_verification.faults.cell import CellError, FaultCell
from winding_verification.faults.cell_faults import (
    SENSOR_FAULTS,
    break_sensor,
    lose_again_and_again,
    lose_frames,
    lose_node,
    lose_successor,
    wrong_parameters,
)
from winding_verification.faults.external_faults import (
    late_joiner,
    lose_orchestrator,
    quality_mismatch,
    rogue_publisher,
    second_graph,
)
from winding_verification.faults.outcome import STAND_WITHIN, Outcome

NAMESPACE = "faults"
_SIGNALS = {"kill -9": signal.SIGKILL, "SIGSTOP": signal.SIGSTOP}

# Faults of a cell that they may ruin, by the name of their row, in the order in which they are
# tried: the cell heals itself before the next one.
ROWS: dict[str, Callable[[FaultCell], Awaitable[Outcome]]] = {
    "20 % frame loss": lose_frames,
    "wrong parameters": wrong_parameters,
    "late joiner": late_joiner,
    "QoS mismatch": quality_mismatch,
    "rogue publisher": rogue_publisher,
    "two rigs on one machine": second_graph,
    **{fault.name: partial(break_sensor, fault=fault) for fault in SENSOR_FAULTS},
    **{
        f"{name} {spec.name}": partial(lose_node, name=spec.name, number=number)
        for name, number in _SIGNALS.items()
        for spec in GRAPH
    },
    "a successor that hangs": partial(lose_successor, name=topics.TRACKER),
    "a node that dies again and again": partial(lose_again_and_again, name=topics.TRACKER),
}
# Faults of a run of their own in a new folder, beside no cell.
LONE_ROWS: dict[str, Callable[[Path], Awaitable[Outcome]]] = {
    f"{name} orchestrator": partial(lose_orchestrator, number=number)
    for name, number in _SIGNALS.items()
}


def row_names() -> list[str]:
    """Return the names of all rows in their order."""
    return [*ROWS, *LONE_ROWS]


async def watched(trial: Awaitable[Outcome]) -> Outcome:
    """Return a trial's outcome with how busy the computer was meanwhile."""
    before = psutil.cpu_times()
    outcome = await trial
    now = psutil.cpu_times()
    spent = sum(now) - sum(before)
    return dataclasses.replace(
        outcome,
        load=max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)),
        idle=float((now.idle - before.idle) / spent) if spent > 0.0 else 1.0,
    )


async def try_rows(
    names: Set[str], folder: Path, report: Callable[[Outcome], None]
) -> list[Outcome]:
    """Try rows on one graph, then those that need a run of their own.

    Args:
        names: Of the rows.
        folder: Existing folder for logs and runs.
        report: Receives each outcome as soon as it is known.
    """
    outcomes: list[Outcome] = []

    async def attempt(name: str, trial: Awaitable[Outcome]) -> None:
        try:
            outcomes.append(await watched(trial))
        except (CellError, GraphError, TimeoutError) as error:
            outcomes.append(Outcome(fault=name, outcome=str(error), survived=False))
        report(outcomes[-1])

    rows = [name for name in ROWS if name in names]
    if rows:
        async with FaultCell(folder / "cell", NAMESPACE).running() as cell:
            for name in rows:
                await attempt(name, ROWS[name](cell))
    for name, trial in LONE_ROWS.items():
        if name in names:
            await attempt(name, trial(folder / name.replace(" ", "-")))
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
