"""What `winding sweep` prints: what was varied beside the lengths that came out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from winding_cli.commands.console import result_console
from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from winding_study.sweep.outcome import Columns

LONGEST = 24


def print_summary(columns: Columns, varied: tuple[str, ...]) -> None:
    """Print the first rows of a sweep's table and how many runs failed.

    Args:
        columns: The whole table.
        varied: Inputs with more than one value; the others are not shown.
    """
    console = result_console()
    rows = columns["run"].size
    lengths = [name for name in columns if name.startswith("p") and name.endswith("_s_m")]
    table = Table(title=f"{rows} runs" + (f", the first {LONGEST}" if rows > LONGEST else ""))
    for name in ("run", *varied):
        table.add_column(name, justify="right")
    for name in lengths:
        table.add_column(f"S{name.split('_')[0][1:]}, mm", justify="right")
    for name in ("stretch", "cable a turn, mm", "balance, %", "status"):
        table.add_column(name, justify="left" if name == "status" else "right")
    for row in range(min(rows, LONGEST)):
        used = columns["cable_per_turn_m"][row] / MILLIMETRE
        table.add_row(
            str(columns["run"][row]),
            *(_text(columns[name][row]) for name in varied),
            *(_number(columns[name][row] / MILLIMETRE, ".2f") for name in lengths),
            _number(columns["stretch"][row], ".5f"),
            _number(np.nanmean(used) if np.isfinite(used).any() else np.nan, ".2f"),
            _number(columns["energy_balance_pct"][row], ".2g"),
            str(columns["status"][row]),
        )
    console.print(table)
    failed = int((columns["status"] != "ok").sum())
    console.print(
        f"{rows - failed} runs ok, {failed} failed; "
        f"{np.nansum(columns['cpu_s']):.1f} CPU seconds of winding",
        highlight=False,
    )


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"
