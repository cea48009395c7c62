"""The console that results go to: as wide as the terminal, and wide enough in a pipe."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

PIPE_WIDTH = 200


def result_console() -> Console:
    """Return a console on stdout that cuts no table in a pipe or a file, which have no width."""
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=PIPE_WIDTH)
