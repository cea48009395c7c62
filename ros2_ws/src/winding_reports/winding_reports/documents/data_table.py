"""A table of numbers that is the same on the terminal, in CSV, in JSON and on the page."""

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

from winding_core.units import known
from winding_reports.documents.page import MISSING

Value = int | float | str | None


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column of a table."""

    name: str  # With its unit; the same wherever the table is shown
    digits: int = 2  # Decimals when it is shown
    mean: bool = False  # Whether the mean over the rows is meaningful


@dataclass(frozen=True, kw_only=True)
class DataTable:
    """Numbers and names in rows."""

    name: str  # Short, for files and keys
    title: str  # What it compares
    columns: tuple[Column, ...]  # Left to right; rows that begin alike belong together
    rows: tuple[tuple[Value, ...], ...]  # A value for each column; None where there is no number
    note: str = ""  # How to read it

    @property
    def means(self) -> dict[str, float]:
        """Mean of every column that has one, over the rows that have a number."""
        found = {}
        for column in self.columns:
            numbers = self.numbers(column.name) if column.mean else []
            if numbers:
                found[column.name] = fmean(numbers)
        return found

    def column(self, name: str) -> list[Value]:
        """Return one column.

        Raises:
            ValueError: There is no such column.
        """
        index = [column.name for column in self.columns].index(name)
        return [row[index] for row in self.rows]

    def numbers(self, name: str) -> list[float]:
        """Return the numbers of one column, without what is missing.

        Raises:
            ValueError: There is no such column.
        """
        return [v for v in self.column(name) if isinstance(v, float) and math.isfinite(v)]

    @property
    def worded(self) -> list[bool]:
        """Whether each column holds words, which stand to the left, or numbers."""
        first = self.rows[0] if self.rows else ()
        return [isinstance(value, str) for value in first] or [False] * len(self.columns)

    def texts(self) -> list[list[str]]:
        """Return rows as they are shown: rounded, the first column only where it changes."""
        shown = []
        before: Value = None
        for row in self.rows:
            texts = [
                _text(value, column.digits) for value, column in zip(row, self.columns, strict=True)
            ]
            if row[0] == before:
                texts[0] = ""
            before = row[0]
            shown.append(texts)
        return shown

    def mean_texts(self) -> list[str]:
        """Return the row of means as it is shown, or nothing when no column has a mean."""
        means = self.means
        if not means:
            return []
        return [
            "mean",
            *(
                _text(means[column.name], column.digits) if column.name in means else ""
                for column in self.columns[1:]
            ),
        ]

    def as_json(self) -> dict[str, Any]:
        """Return the table as JSON values."""
        return {
            "title": self.title,
            "columns": [column.name for column in self.columns],
            "rows": [[known(value) for value in row] for row in self.rows],
            "means": self.means,
        }

    def as_csv(self) -> str:
        """Return the table as CSV text: names and rows, without rounding and without means."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([column.name for column in self.columns])
        for row in self.rows:
            writer.writerow([known(value) for value in row])
        return text.getvalue()

    def write_parquet(self, path: Path) -> None:
        """Write the table as Parquet; what is not known is null. Needs pyarrow."""
        # Only who wants Parquet waits for it to load.
        import pyarrow as pa  # type: ignore[import-untyped]  # noqa: PLC0415
        import pyarrow.parquet as pq  # type: ignore[import-untyped]  # noqa: PLC0415

        names = [column.name for column in self.columns]
        columns = {name: [known(value) for value in self.column(name)] for name in names}
        pq.write_table(pa.table(columns), path)


def _text(value: Value, digits: int) -> str:
    value = known(value)
    if value is None:
        return MISSING
    return f"{value:.{digits}f}" if isinstance(value, float) else str(value)
