"""How a command refuses: one sentence on stderr and a non-zero exit, before anything moves."""

from __future__ import annotations

import sys
from typing import NoReturn

import typer

REFUSED = 2
FAILED = 1


def refuse(sentence: object, code: int = REFUSED) -> NoReturn:
    """End the command with one sentence."""
    print(f"winding: {sentence}", file=sys.stderr)
    raise typer.Exit(code)
