"""The console that results go to, and what a terminal shows while a command is busy."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn

PIPE_WIDTH = 200


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
