"""What a command imports for its end while it waits for something else."""

from __future__ import annotations

import threading
from importlib import import_module


def import_early(module: str) -> None:
    """Begin to import a module beside everything else; whoever imports it later waits for that."""
    threading.Thread(target=import_module, args=(module,), name=f"import {module}").start()
