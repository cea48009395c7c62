"""Rows of the benchmark: collected in a session, shown as a table, kept in one JSON file."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

RESULTS = Path(__file__).parents[1] / "bench.json"

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
        cpu_s: Of a ratio, the processor time above and below the line [s], in whatever unit both
            are measured: a call, a frame, a simulated second.
        load: Of a ratio, the machine's load average when it was measured.
    """

    name: str
    value: float
    unit: str
    bar: float | None = None
    at_least: bool = False
    cpu_s: tuple[float, float] | None = None
    load: float | None = None

    @property
    def met(self) -> bool:
        """Whether the bar holds; without one it does."""
        if self.bar is None:
            return True
        return self.value >= self.bar if self.at_least else self.value <= self.bar

    def entry(self) -> dict[str, Any]:
        """Return what bench.json keeps of it."""
        kept: dict[str, Any] = {"name": self.name, "value": self.value, "unit": self.unit}
        if self.cpu_s is not None:
            kept |= {"cpu_s": list(self.cpu_s), "load": self.load}
        return kept


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

    def ratio(
        self,
        name: str,
        above: float,
        below: float,
        bar: float | None = None,
        *,
        value: float | None = None,
    ) -> Row:
        """Add the ratio of two processor times [s], with both and the load beside it.

        Args:
            name: See `Row`.
            above: The line.
            below: The line.
            bar: See `Row`.
            value: The ratio, where it is not that of the two, as the median of several pairs.
        """
        added = Row(
            name=name,
            value=above / below if value is None else value,
            unit="",
            bar=bar,
            cpu_s=(above, below),
            load=os.getloadavg()[0],
        )
        self.rows[name] = added
        return added

    def table(self) -> Table:
        """Return the rows as a table for a terminal."""
        table = Table(title="Benchmark: processor time of one thread unless the unit has wall")
        for column in ("row", "value", "unit", "bar", "met", "CPU s", "load"):
            left = column in ("row", "unit", "met")
            table.add_column(column, justify="left" if left else "right", no_wrap=column == "row")
        for row in self.rows.values():
            sign = ">=" if row.at_least else "<="
            table.add_row(
                row.name,
                f"{row.value:.4g}",
                row.unit,
                "" if row.bar is None else f"{sign} {row.bar:g}",
                "" if row.bar is None else ("yes" if row.met else "NO"),
                "" if row.cpu_s is None else "{:.3g} / {:.3g}".format(*row.cpu_s),
                "" if row.load is None else f"{row.load:.1f}",
            )
        return table


def costs(count: int, action: Callable[[int], Any]) -> tuple[np.ndarray, list[Any]]:
    """Call an action with 0, 1, ...; return the processor time of each call [s] and its results."""
    spent, results = np.empty(count), []
    for k in range(count):
        started = time.thread_time()
        results.append(action(k))
        spent[k] = time.thread_time() - started
    return spent, results


def least(rounds: int, *measurements: Callable[[], Any]) -> list[Any]:
    """Take measurements in turn for several rounds; return the least of each.

    What other processes do can only make a round dearer, and the first one may compile. A
    measurement that returns an array counts element by element.
    """
    taken = [[measure() for measure in measurements] for _ in range(rounds)]
    return [np.min(column, axis=0) for column in zip(*taken, strict=True)]


def keep(rows: Iterable[Row], path: Path = RESULTS) -> None:
    """Write rows by name; rows of earlier sessions with other names stay.

    The file is replaced at once, so that a reader never sees half of it.
    """
    stored = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []
    merged = {entry["name"]: entry for entry in stored}
    for row in rows:
        merged[row.name] = row.entry()
    draft = path.with_suffix(".json.part")
    draft.write_text(
        json.dumps(list(merged.values()), indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    os.replace(draft, path)
