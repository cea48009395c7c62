"""How a command refuses: one sentence on stderr and a non-zero exit, before anything moves."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points
from importlib.util import find_spec
from typing import Any, NoReturn

import typer

REFUSED = 2
FAILED = 1
# Extra of the project -> modules that it brings.
_MODULES = {"train": ("torch", "sklearn"), "tables": ("pyarrow",)}


def refuse(sentence: object, code: int = REFUSED) -> NoReturn:
    """End the command with one sentence."""
    complain(sentence)
    raise typer.Exit(code)


def complain(sentence: object) -> None:
    """Print one sentence on stderr, now."""
    print(f"winding: {sentence}", file=sys.stderr, flush=True)


def fail() -> NoReturn:
    """End the command whose failure has been reported already."""
    raise typer.Exit(FAILED)


@contextmanager
def refused(*errors: type[Exception], code: int = REFUSED) -> Iterator[None]:
    """End the command with the sentence of any of these errors in the body."""
    try:
        yield
    except errors as error:
        refuse(error, code)


def need_extra(extra: str, what: str) -> None:
    """End a command whose libraries are not installed.

    Args:
        extra: Of the project.
        what: What the command does with them, as the beginning of a sentence.
    """
    missing = [name for name in _MODULES[extra] if find_spec(name) is None]
    if missing:
        refuse(f"{what} needs {' and '.join(missing)}: pip install 'cable-winding-twin[{extra}]'")


def evidence(name: str) -> Callable[..., Any] | None:
    """Return an entry point of the group `winding.evidence`; None where it is not installed."""
    points = entry_points(group="winding.evidence", name=name)
    return next((point.load() for point in points), None)
