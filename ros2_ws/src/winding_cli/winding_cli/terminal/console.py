"""The console that results go to, tables of records on it, and the bar of a busy command."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import ProgressColumn
    from rich.table import Table

    from winding_core.compile_progress import Compiling

PIPE_WIDTH = 200
MISSING = "-"
# Time to the first line of progress in a log, and the longest between two [s].
FIRST_LINE = 2.0
LONGEST_SILENCE = 60.0

Show = Callable[..., None]


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


def six_digits(value: object) -> str:
    """Return a value of any kind as it is shown, a number to six digits."""
    if value is None:
        return MISSING
    return f"{value:.6g}" if isinstance(value, float) else str(value)


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


def result_console() -> Console:
    """Return a console on stdout that cuts no table in a pipe or a file, which have no width."""
    from rich.console import Console

    console = Console(highlight=False)
    return console if console.is_terminal else Console(width=PIPE_WIDTH, highlight=False)


@contextmanager
def busy(description: str, *columns: ProgressColumn, total: float | None = None) -> Iterator[Show]:
    """Show on stderr that the command is at work: a bar on a terminal, else a line now and then.

    What takes less than FIRST_LINE prints no line. Kernels that are compiled in the body are shown.

    Args:
        description: What it is at.
        columns: What stands behind the description and the bar.
        total: How much there is to do, as a count or a share (1); None where that is not known.

    Yields:
        Takes `description`, `completed`, `advance` or `total` as they change.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from winding_core.compile_progress import PROGRESS

    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        *columns,
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(description, total=total)

        def show(**changes: Any) -> None:
            nonlocal description
            description = changes.get("description", description)
            bar.update(task, **changes)

        def compiling(kernel: Compiling | None) -> None:
            bar.update(task, description=description if kernel is None else kernel.sentence)

        def line() -> str:
            (state,) = bar.tasks
            share = "" if not state.total else f", {state.percentage:.0f} %"
            return f"winding: {state.description}{share}, {state.elapsed:.0f} s"

        with PROGRESS.heard(compiling), nullcontext() if console.is_terminal else _lines(line):
            yield show


@contextmanager
def _lines(line: Callable[[], str]) -> Iterator[None]:
    """Print a line on stderr now and then, ever more rarely."""
    over = threading.Event()

    def work() -> None:
        wait = FIRST_LINE
        while not over.wait(wait):
            # Its reader may have gone.
            with suppress(BrokenPipeError):
                print(line(), file=sys.stderr, flush=True)
            wait = min(2.0 * wait, LONGEST_SILENCE)

    thread = threading.Thread(target=work, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
