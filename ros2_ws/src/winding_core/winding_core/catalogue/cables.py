"""The library of cables: files with data, uncertainty and source, shipped and own."""

import difflib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml

from winding_core.cable.cases import Material
from winding_core.cable.condition import ALTERNATIVES, Condition
from winding_core.cable.material_law import LawParameters
from winding_core.cell_file import CellError, CellFile, read_cell
from winding_core.parameters import ParameterError, options, typed_values
from winding_core.run_options import SolverOptions

_CONDITION = options(Condition)
_OF_CABLE = {"cable_diameter", *vars(Material()), "prony", *vars(LawParameters())}
# Options of a run that a cable states; the others of its condition are those of a trial winding.
PROPERTIES = tuple(key for key, item in _CONDITION.items() if item.name in _OF_CABLE)
_TRIAL = tuple(key for key in _CONDITION if key not in (*PROPERTIES, "case"))
_HEAD = ("title", "source", "note")
_SECTIONS = {
    "cable": dict.fromkeys(_HEAD),
    "properties": dict.fromkeys(PROPERTIES),
    "uncertainty": dict.fromkeys(PROPERTIES),
    "sources": dict.fromkeys(PROPERTIES),
    "winding": dict.fromkeys((*_TRIAL, *options(SolverOptions))),
}
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_SUFFIX = ".yaml"
# What a run that is to be wound otherwise than the trial states.
_OTHERWISE = ("case", "cylinder_diameter_mm")


class CableError(ParameterError):
    """There is no such cable, or its file is refused."""


@dataclass(frozen=True, kw_only=True)
class Cable:
    """A cable as a file of the library states it; every value in the unit of its option."""

    name: str  # Of the file, without its ending
    title: str  # What it is, in words
    source: str = ""  # Of the data as a whole
    note: str = ""  # What else is to be known
    properties: Mapping[str, Any] = field(default_factory=dict)  # Value by option
    uncertainty: Mapping[str, float] = field(default_factory=dict)  # One standard deviation of it
    sources: Mapping[str, str] = field(default_factory=dict)  # Where it is from
    winding: Mapping[str, Any] = field(default_factory=dict)  # Options of a trial winding
    path: Path | None = None  # Of the file of an own one; None for one that is shipped

    def below(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return options of a run with the cable's where nothing else is given.

        The trial winding is wound where neither case nor cylinder is given.
        """
        trial = {} if given.keys() & {*_OTHERWISE} else self.winding
        replaced = {key for group in ALTERNATIVES if given.keys() & {*group} for key in group}
        brought = {**trial, **self.properties}
        return {key: brought[key] for key in brought if key not in replaced} | dict(given)

    def text(self) -> str:
        """Return the file of the cable."""
        head = {"title": self.title, "source": self.source, "note": self.note}
        content = {
            "cable": {key: text for key, text in head.items() if text},
            "properties": dict(self.properties),
            "uncertainty": dict(self.uncertainty),
            "sources": dict(self.sources),
            "winding": dict(self.winding),
        }
        kept = {name: values for name, values in content.items() if values}
        return yaml.safe_dump(kept, sort_keys=False, allow_unicode=True, width=100)


def own_folder() -> Path:
    """Return the user's folder of cables, by the XDG base directory specification."""
    configured = os.environ.get("XDG_DATA_HOME", "")
    # The specification ignores a relative path.
    data = Path(configured) if Path(configured).is_absolute() else Path.home() / ".local" / "share"
    return data / "cable-winding-twin" / "cables"


def cables(library: Path | None = None) -> dict[str, Cable]:
    """Return every cable by its name; an own one stands for a shipped one of its name.

    Args:
        library: Folder of own cables; None for the user's.

    Raises:
        CableError: A file is refused, or the folder is none.
    """
    found = {path.stem: read_cable(path, shipped=True) for path in _shipped()}
    for path in _own(library):
        found[path.stem] = read_cable(path)
    return dict(sorted(found.items()))


def find_cable(name: str, library: Path | None = None) -> Cable:
    """Return a cable.

    Args:
        name: Of a cable of the library, or a cable file.
        library: Folder of own cables; None for the user's.

    Raises:
        CableError: There is none, or its file is refused.
    """
    if name.endswith((_SUFFIX, ".yml")) or os.sep in name:
        return read_cable(Path(name))
    own = {path.stem: path for path in _own(library)}
    shipped = {path.stem: path for path in _shipped()}
    if name in own:
        return read_cable(own[name])
    if name in shipped:
        return read_cable(shipped[name], shipped=True)
    near = difflib.get_close_matches(name, [*own, *shipped], n=1)
    hint = f"did you mean {near[0]}?" if near else "`winding cable list` shows all"
    raise CableError(f"the library has no cable {name[:120]!r}; {hint}")


def with_cable(given: Mapping[str, Any], library: Path | None = None) -> dict[str, Any]:
    """Return options of a run with those of the cable that `cable` names where it names one.

    Raises:
        CableError: There is no such cable.
    """
    name = given.get("cable")
    return dict(given) if not name else find_cable(str(name), library).below(given)


def read_cable(path: Path, *, shipped: bool = False) -> Cable:
    """Return the cable of a file.

    Raises:
        CableError: The file is refused; the sentence names the place in it.
    """
    if not path.is_file():
        raise CableError(f"there is no cable file {path}")
    try:
        content = read_cell(path, _SECTIONS)
        return _cable(path, content, shipped=shipped)
    except CellError as error:
        raise CableError(str(error).replace("a cell file", "a cable file")) from error


def check_name(name: str) -> str:
    """Return the name of a cable.

    Raises:
        CableError: It cannot be the name of a file of the library.
    """
    if not _NAME.fullmatch(name) or name.endswith((_SUFFIX, ".yml")):
        raise CableError(
            f"a cable's name is of letters, digits, '.', '_' and '-', 100 at most, got {name!r}"
        )
    return name


def check_cable(cable: Cable) -> Cable:
    """Return a cable whose values may be wound.

    Raises:
        CableError: One is missing, or an uncertainty is refused.
        ParameterError: A value is refused.
    """
    typed_values(Condition, cable.properties)
    if "cable_diameter_mm" not in cable.properties or "young_mpa" not in cable.properties:
        raise CableError("a cable needs cable_diameter_mm and young_mpa")
    for key, sigma in cable.uncertainty.items():
        _check_uncertainty(key, sigma, cable.properties)
    return cable


def _cable(path: Path, content: CellFile, *, shipped: bool) -> Cable:
    parts: dict[str, dict[str, Any]] = content.by_section
    for section, owner in (("properties", Condition), ("winding", None)):
        for key, value in parts[section].items():
            kind = owner or (SolverOptions if key in options(SolverOptions) else Condition)
            try:
                typed_values(kind, {key: value})
            except ParameterError as error:
                content.places[section, key].refuse(error)
    for section in ("cable", "sources"):
        for key, value in parts[section].items():
            if not isinstance(value, str):
                content.places[section, key].refuse(f"{key} must be a text, got {value!r}")
    for key, value in parts["uncertainty"].items():
        try:
            _check_uncertainty(key, value, parts["properties"])
        except ParameterError as error:
            content.places["uncertainty", key].refuse(error)
    head: dict[str, Any] = parts.pop("cable")
    rest: dict[str, Any] = parts
    try:
        return check_cable(
            Cable(
                name=path.stem,
                title=head.pop("title", path.stem),
                **head,
                **rest,
                path=None if shipped else path,
            )
        )
    except ParameterError as error:
        content.start.refuse(error)


def _check_uncertainty(key: str, sigma: object, properties: Mapping[str, Any]) -> None:
    value = properties.get(key)
    if isinstance(value, str | bool | None):
        raise CableError(f"an uncertainty of {key} needs a number {key} among the properties")
    number = isinstance(sigma, int | float) and not isinstance(sigma, bool)
    if not (number and 0.0 < float(sigma) < float("inf")):  # type: ignore[arg-type]
        raise CableError(f"an uncertainty must be a positive number, got {sigma!r} of {key}")


def _shipped() -> list[Path]:
    folder = Path(str(files("winding_core"))) / "data"
    return sorted(folder.glob(f"*{_SUFFIX}"))


def _own(library: Path | None) -> list[Path]:
    if library is not None and not library.is_dir():
        raise CableError(f"there is no folder of cables {library}")
    return sorted((library or own_folder()).glob(f"*{_SUFFIX}"))
