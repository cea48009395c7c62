"""Where the code of a camera is found that runs in the tracker's process: MODULE:FUNCTION."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class CameraSourceError(ValueError):
    """There is no such camera."""


@dataclass(frozen=True, kw_only=True)
class CameraSource:
    """A function that opens a camera, and where it stands."""

    place: str  # Name of a module, or path of a Python file.
    function: str  # Its name there.

    @classmethod
    def parsed(cls, text: str) -> CameraSource:
        """Return a source from `my_camera:open_camera` or `drivers/my_camera.py:open_camera`.

        Raises:
            CameraSourceError: It is no such text, there is no such file or module, or a package
                above the module cannot be imported.
        """
        place, colon, function = text.rpartition(":")
        if not (place and colon and function.isidentifier()):
            raise CameraSourceError(
                f"a camera is MODULE:FUNCTION or FILE.py:FUNCTION, got {text!r}"
            )
        source = cls(place=place, function=function)
        if source.is_file:
            if not Path(place).is_file():
                raise CameraSourceError(f"no camera at {place}")
        elif _found(place) is None:
            raise CameraSourceError(f"there is no module {place}")
        return source

    @property
    def is_file(self) -> bool:
        """Whether the place is a file rather than a module."""
        return self.place.endswith(".py")

    def load(self) -> Callable[..., Any]:
        """Import the code and return the function.

        Raises:
            CameraSourceError: It cannot be imported, or has no such function.
        """
        try:
            module = self._module()
        except Exception as error:
            raise _unimportable(self.place, error) from error
        found = getattr(module, self.function, None)
        if not callable(found):
            raise CameraSourceError(f"{self.place} has no function {self.function}")
        loaded: Callable[..., Any] = found
        return loaded

    def _module(self) -> Any:
        if not self.is_file:
            return importlib.import_module(self.place)
        name, folder = Path(self.place).stem, str(Path(self.place).resolve().parent)
        if folder not in sys.path:
            # Its neighbours are found from it, as they are when Python runs it.
            sys.path.insert(0, folder)
        spec = importlib.util.spec_from_file_location(name, self.place)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[name]
            raise
        return module


def _found(module: str) -> Any:
    try:
        return importlib.util.find_spec(module)
    except Exception as error:
        # The packages above a module are imported to find it.
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is not None and f"{module}.".startswith(f"{missing}."):
            return None
        raise _unimportable(module, error) from error


def _unimportable(place: str, error: Exception) -> CameraSourceError:
    return CameraSourceError(f"{place} cannot be imported: {type(error).__name__}: {error}")
