"""Conditions that operators keep: cell files in a folder, which `winding run` winds as well."""

import re
from collections.abc import Mapping
from pathlib import Path

from winding_core.run_spec import RunSpec
from winding_dashboard.page.condition_form import label

_SUFFIX = ".yaml"
_NAME = re.compile(r"\w[\w .-]{0,59}", re.ASCII)  # A name is that of a file


class Recipes:
    """The cell files of a folder, by their names without ending.

    Args:
        folder: Made with its first recipe; None for none.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    def names(self) -> list[str]:
        """Return all names in order."""
        if self._folder is None:
            return []
        return sorted(path.stem for path in self._folder.glob(f"*{_SUFFIX}"))

    def save(self, name: str, typed: Mapping[str, object]) -> None:
        """Keep options of a run.

        Raises:
            ValueError: There is no such name or it is taken, the options are refused, or the file
                cannot be written.
        """
        path = self._path(name)
        text = RunSpec.from_cell(None, typed, label).text()
        try:
            path.parent.mkdir(exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            raise ValueError(f"there is a recipe {name} already; take another name") from None
        except OSError as error:
            raise ValueError(f"{path} cannot be written: {error.strerror}") from error

    def load(self, name: str) -> RunSpec:
        """Return a kept run.

        Raises:
            ValueError: There is none of that name, or its file is refused.
        """
        path = self._path(name)
        if not path.is_file():
            raise ValueError(f"there is no recipe {name}")
        return RunSpec.from_cell(path, {})

    def _path(self, name: str) -> Path:
        if self._folder is None:
            raise ValueError("this page has no folder of runs to keep recipes in")
        if not _NAME.fullmatch(name):
            raise ValueError(f"a name has 1 to 60 letters, digits, spaces, - and _, got {name!r}")
        return self._folder / f"{name}{_SUFFIX}"
