"""What renders help, imported without the renderers of Markdown and tracebacks, of no use to it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

# Half the processor time of `winding --help`; the name is what Typer takes from the module.
_NEEDLESS = {"rich.markdown": "Markdown", "rich.traceback": "Traceback"}
# Rich shows objects of this library in a way of their own, where it is there.
_ABSENT = "attr"


def import_help() -> None:
    """Import Typer's renderer of help; a second call does nothing."""
    if "typer.rich_utils" in sys.modules:
        return
    with _stand_ins():
        import typer.rich_utils  # noqa: F401


@contextmanager
def _stand_ins() -> Iterator[None]:
    modules: dict[str, ModuleType | None] = {_ABSENT: None}
    for name, member in _NEEDLESS.items():
        module = ModuleType(name)
        setattr(module, member, type(member, (), {}))
        modules[name] = module
    modules = {name: module for name, module in modules.items() if name not in sys.modules}
    sys.modules.update(modules)  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in modules:
            del sys.modules[name]
