"""What `winding study --closed-loop` prints and writes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.progress import MofNCompleteColumn
from rich.table import Table

from winding_cli.terminal.console import busy, result_console
from winding_cli.terminal.output_path import write_json


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
    from winding_core.lay.errors import LayTolerance
    from winding_verification.closed_loop.study import (
        ClosedLoopConfig,
        closed_loop_study,
        miss_summary,
        summary,
        verdict,
    )

    config = ClosedLoopConfig(cases=cases, draws=draws, brake=brake)
    with busy("runs with hidden rigs", MofNCompleteColumn()) as show:
        rows = closed_loop_study(
            config,
            processes=processes,
            progress=lambda done, runs: show(completed=done, total=runs),
        )
    result_console().print(verdict(rows, LayTolerance.lay_tolerance), soft_wrap=True)
    result_console().print(
        _table(
            f"|z - even helix| in mm over {len(cases)} cases and {draws} hidden rigs of each: "
            "median, 95th percentile, worst",
            ("true cable", "loop"),
            summary(rows),
            1.0e3,
        )
    )
    if brake:
        result_console().print(
            _table(
                "how far markers miss their angles, in % of a turn: median, 95th percentile, "
                "worst; and the share of runs within the bar or within two deviations as "
                "predicted beforehand",
                ("true cable",),
                miss_summary(rows),
                100.0,
            )
        )
    write_json(json, [row.record() for row in rows])


def _table(
    title: str, left: Sequence[str], found: Mapping[Any, Mapping[str, Any]], factor: float
) -> Table:
    """Return a table of percentiles times a factor, a row for each key, a column for each name."""
    table = Table(title=title, show_lines=True)
    for name in left:
        table.add_column(name)
    names = max((list(parts) for parts in found.values()), key=len)
    for name in names:
        table.add_column("turns 3 and on" if name == "turns" else name, justify="right")
    for key, parts in found.items():
        cells = [[f"{factor * value:.2f}" for value in parts.get(name, ())] for name in names]
        table.add_row(*((key,) if isinstance(key, str) else key), *map("\n".join, cells))
    return table
