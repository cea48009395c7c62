"""What `winding study --closed-loop` prints and writes."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import MofNCompleteColumn
from rich.table import Table

from winding_cli.commands.console import progress_bar, result_console

if TYPE_CHECKING:
    from winding_verification.closed_loop.study import ClosedLoopRow


def closed_loop(
    cases: tuple[int, ...], draws: int, processes: int, json: Path | None, *, brake: bool
) -> None:
    """Wind the cases under hidden rigs, closed and open loop; print percentiles.

    Args:
        cases: Rows of Table 1.
        draws: Hidden rigs of each.
        processes: Runs at a time.
        json: File of every run; None for none.
        brake: Whether a brake lands markers at angles within its reach.
    """
    from winding_core.lay_tolerance import LayTolerance
    from winding_verification.closed_loop.study import ClosedLoopConfig, closed_loop_study, verdict

    config = ClosedLoopConfig(cases=cases, draws=draws, brake=brake)
    with progress_bar(MofNCompleteColumn()) as bar:
        task = bar.add_task("runs with hidden rigs", total=None)

        def show(done: int, runs: int) -> None:
            bar.update(task, completed=done, total=runs)

        rows = closed_loop_study(config, processes=processes, progress=show)
    result_console().print(
        verdict(rows, LayTolerance.lay_tolerance), highlight=False, soft_wrap=True
    )
    result_console().print(_table(rows, draws))
    if brake:
        result_console().print(_misses(rows))
    if json is not None:
        json.write_text(json_format.dumps([row.record() for row in rows], indent=1) + "\n")


def _table(rows: list[ClosedLoopRow], draws: int) -> Table:
    from winding_verification.closed_loop.study import summary

    cases = len({row.case for row in rows})
    table = Table(
        title=f"|z - even helix| in mm over {cases} cases and {draws} hidden rigs of each: "
        "median, 95th percentile, worst",
        show_lines=True,
    )
    table.add_column("true cable")
    table.add_column("loop")
    found = summary(rows)
    names = max((list(parts) for parts in found.values()), key=len)
    for name in names:
        table.add_column("turns 3 and on" if name == "turns" else name, justify="right")
    for (truth, mode), parts in found.items():
        cells = [
            "\n".join(f"{1.0e3 * value:.2f}" for value in parts[name]) if name in parts else ""
            for name in names
        ]
        table.add_row(truth, mode, *cells)
    return table


def _misses(rows: list[ClosedLoopRow]) -> Table:
    from winding_verification.closed_loop.study import miss_summary

    table = Table(
        title="how far markers miss their angles, in % of a turn: median, 95th percentile, worst; "
        "and the share of runs within the bar or within two deviations as predicted beforehand",
        show_lines=True,
    )
    found = miss_summary(rows)
    names = max((list(parts) for parts in found.values()), key=len)
    table.add_column("true cable")
    for name in names:
        table.add_column(name, justify="right")
    for truth, parts in found.items():
        cells = ["\n".join(f"{100.0 * value:.2f}" for value in parts.get(n, ())) for n in names]
        table.add_row(truth, *cells)
    return table
