"""Rows of the benchmark: collected in a session, shown as a table, kept in one JSON file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

RESULTS = Path(__file__).parents[2] / "bench.json"

# Numba and the linear algebra under NumPy read these when they are first imported.
SINGLE_THREAD = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@dataclass(frozen=True, kw_only=True)
class Row:
    """One measured number.

    Attributes:
        name: Stays the same from session to session.
        value: In `unit`.
        unit: As printed.
        bar: What it must not exceed, if anything.
        at_least: The bar is a floor, not a ceiling.
    """

    name: str
    value: float
    unit: str
    bar: float | None = None
    at_least: bool = False

    @property
    def met(self) -> bool:
        """Whether the bar holds; without one it does."""
        if self.bar is None:
            return True
        return self.value >= self.bar if self.at_least else self.value <= self.bar


class Bench:
    """Rows of one session, in the order of their measurement."""

    def __init__(self) -> None:
        self.rows: dict[str, Row] = {}

    def row(
        self,
        name: str,
        value: float,
        unit: str,
        bar: float | None = None,
        *,
        at_least: bool = False,
    ) -> Row:
        """Add a row, in place of an earlier one of the same name, and return it."""
        added = Row(name=name, value=float(value), unit=unit, bar=bar, at_least=at_least)
        self.rows[name] = added
        return added

    def table(self) -> Table:
        """Return the rows as a table for a terminal."""
        table = Table(title="Benchmark: processor time of one thread unless it says wall")
        for column in ("row", "value", "unit", "bar", "met"):
            table.add_column(column, justify="right" if column in ("value", "bar") else "left")
        for row in self.rows.values():
            sign = ">=" if row.at_least else "<="
            table.add_row(
                row.name,
                f"{row.value:.4g}",
                row.unit,
                "" if row.bar is None else f"{sign} {row.bar:g}",
                "" if row.bar is None else ("yes" if row.met else "NO"),
            )
        return table


def keep(rows: Iterable[Row], path: Path = RESULTS) -> None:
    """Write rows as `{name, value, unit}`; rows of earlier sessions with other names stay.

    The file is replaced at once, so that a reader never sees half of it.
    """
    stored = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []
    merged = {entry["name"]: entry for entry in stored}
    for row in rows:
        merged[row.name] = {"name": row.name, "value": row.value, "unit": row.unit}
    draft = path.with_suffix(".json.part")
    draft.write_text(
        json.dumps(list(merged.values()), indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    os.replace(draft, path)
