"""The console that results go to, tables of records on it, and the bar of a busy command."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn
    from rich.table import Table

PIPE_WIDTH = 200
MISSING = "-"


class Shown(NamedTuple):
    """How a table shows one value of a record, which a JSON file has as it is."""

    heading: str  # Of the column, with the unit
    value: str | Callable[[Any], Any]  # Key of the record, or what returns the value of one
    form: str = ""  # Format of a number; words are shown as they are
    unit: float = 1.0  # One shown unit in the record's own, such as a millimetre in metres
    missing: str = MISSING  # In place of None and of a number that is not finite

    def text(self, record: Any) -> str:
        """Return the value of a record as it is shown."""
        value = record[self.value] if isinstance(self.value, str) else self.value(record)
        if isinstance(value, str):
            return value
        if value is None or not math.isfinite(value):
            return self.missing
        return format(value if self.unit == 1.0 else value / self.unit, self.form)


def record_table(
    columns: Iterable[Shown], records: Iterable[Any], *, words: int = 0, **settings: Any
) -> Table:
    """Return a table of records, one row each.

    Args:
        columns: What is shown of a record, from left to right.
        records: The rows.
        words: How many of the first columns stand to the left.
        settings: Of the table, such as its title.
    """
    from rich.table import Table

    columns = tuple(columns)
    table = Table(**settings)
    for number, column in enumerate(columns):
        table.add_column(column.heading, justify="left" if number < words else "right")
    for record in records:
        table.add_row(*(column.text(record) for column in columns))
    return table


def marker_name(record: Any) -> str:
    """Return how people call the marker of a record."""
    return f"P{record['id']}"


def known(value: float) -> float | None:
    """Return a number, or None in place of one that is not finite, which JSON has not."""
    return value if math.isfinite(value) else None


def result_console() -> Console:
    """Return a console on stdout that cuts no table in a pipe or a file, which have no width."""
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=PIPE_WIDTH)


def progress_bar(*columns: ProgressColumn) -> Progress:
    """Return a bar on stderr, which goes when it has ended and shows on a terminal only.

    Args:
        columns: What stands behind the description and the bar.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        *columns,
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
