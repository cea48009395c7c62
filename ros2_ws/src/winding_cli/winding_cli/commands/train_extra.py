"""What learns a correction is installed only where somebody learns one."""

from __future__ import annotations

from importlib.util import find_spec

from winding_cli.commands.refusal import refuse

_LIBRARIES = ("torch", "sklearn")


def need_train_extra(command: str) -> None:
    """End a command that trains models where their libraries are not installed."""
    missing = [name for name in _LIBRARIES if find_spec(name) is None]
    if missing:
        refuse(
            f"winding {command} trains models, which needs {' and '.join(missing)}: "
            "pip install 'cable-winding-twin[train]'"
        )
