"""How a command refuses: one sentence on stderr and a non-zero exit, before anything moves."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import typer

REFUSED = 2
FAILED = 1


def refuse(sentence: object, code: int = REFUSED) -> NoReturn:
    """End the command with one sentence."""
    complain(sentence)
    raise typer.Exit(code)


def complain(sentence: object) -> None:
    """Say one sentence on stderr, now."""
    print(f"winding: {sentence}", file=sys.stderr, flush=True)


def fail() -> NoReturn:
    """End the command whose failure has been said already."""
    raise typer.Exit(FAILED)


@contextmanager
def refused(*errors: type[Exception], code: int = REFUSED) -> Iterator[None]:
    """End the command with the sentence of any of these errors in the body."""
    try:
        yield
    except errors as error:
        refuse(error, code)
