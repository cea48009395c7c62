"""Libraries that only some commands need are installed where somebody uses those."""

from __future__ import annotations

from importlib.util import find_spec

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
