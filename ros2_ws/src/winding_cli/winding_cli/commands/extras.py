"""Libraries that only some commands need are installed where somebody uses those."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from importlib.util import find_spec
from typing import Any

from winding_cli.commands.refusal import refuse

# Extra of the project -> modules that it brings.
_MODULES = {"train": ("torch", "sklearn"), "tables": ("pyarrow",)}


def need_extra(extra: str, what: str) -> None:
    """End a command whose libraries are not installed.

    Args:
        extra: Of the project.
        what: What the command does with them, as the beginning of a sentence.
    """
    missing = [name for name in _MODULES[extra] if find_spec(name) is None]
    if missing:
        refuse(f"{what} needs {' and '.join(missing)}: pip install 'cable-winding-twin[{extra}]'")


def evidence(name: str) -> Callable[..., Any]:
    """Return what the package of evidence brings under a name; end the command without it.

    Args:
        name: Of an entry point of the group `winding.evidence`.
    """
    for point in entry_points(group="winding.evidence", name=name):
        loaded: Callable[..., Any] = point.load()
        return loaded
    refuse(f"{name} is evidence, and the package winding_verification is not installed")
