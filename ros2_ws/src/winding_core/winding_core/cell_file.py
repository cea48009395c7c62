"""A cell file: YAML that describes a run, read with the place of every value."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import yaml

from winding_core.parameters import ParameterError, refuse_unknown
from winding_core.yaml_text import MOST_CHARACTERS, PlainLoader

# Sections, options, numbers of a list; a text of brackets alone would exhaust the interpreter.
_DEEPEST = 4
# Longer whole numbers are no value of any option, and Python does not read them.
_MOST_DIGITS = 400
_WHOLE = re.compile(r"[-+]?[0-9]+")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
Known = Mapping[str, Mapping[str, object]]  # Section -> its options


class CellError(ValueError):
    """A cell file is refused; the sentence names its place."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where something stands in a file."""

    file: str
    line: int = 1  # From 1
    column: int = 1  # From 1

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}, column {self.column}"

    def refuse(self, sentence: object) -> NoReturn:
        """Raise CellError with this place."""
        raise CellError(f"{self}: {sentence}")


@dataclass(frozen=True, kw_only=True)
class CellFile:
    """What a cell file states."""

    start: Place  # Its first line
    by_section: dict[str, dict[str, object]]  # Section -> option -> value
    sections: dict[str, Place] = field(default_factory=dict)  # Of the sections' names
    places: dict[tuple[str, str], Place] = field(default_factory=dict)  # Of (section, option)

    @property
    def values(self) -> dict[str, object]:
        """Value by option, for files whose sections share no option."""
        return {key: self.by_section[section][key] for section, key in self.places}


class _CellLoader(PlainLoader):
    """YAML without aliases, anchors, tags and depth."""

    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        what = ""
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            what = "anchors and aliases are not taken: write the value out"
        elif getattr(event, "tag", None) is not None:
            what = "tags are not taken"
        elif self._depth >= _DEEPEST:
            what = "nested too deeply"
        if what:
            raise yaml.MarkedYAMLError(problem=what, problem_mark=event.start_mark)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


def read_cell(path: Path, known: Known) -> CellFile:
    """Return what a cell file states.

    Raises:
        CellError: It cannot be read, or something in it is refused.
    """
    start = Place(file=str(path))
    if not path.is_file():
        raise CellError(f"there is no cell file {path}; `winding cell init {path}` writes one")
    try:
        with path.open("rb") as stream:
            data = stream.read(MOST_CHARACTERS + 1)
    except OSError as error:
        raise CellError(f"{path} cannot be read: {error.strerror or error}") from error
    if len(data) > MOST_CHARACTERS:
        start.refuse(f"a cell file has at most {MOST_CHARACTERS} bytes")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        Place(file=str(path), line=line).refuse("this is no text in UTF-8")
    return parse_cell(text, start, known)


def parse_cell(text: str, start: Place, known: Known) -> CellFile:
    """Return what the text of a cell file states; see `read_cell`."""
    found = CellFile(start=start, by_section={name: {} for name in known})
    for name, node, place in _pairs(_composed(text, start), start.file, "a cell file"):
        _check_name(name, "", known, place)
        found.sections[name] = place
        for key, value, at in _pairs(node, start.file, f"section {name}"):
            _check_name(key, name, known, at)
            found.places[name, key] = _place(value.start_mark, start.file)
            found.by_section[name][key] = _value(value, key, start.file)
    return found


def cell_text(given: Mapping[str, Mapping[str, object]]) -> str:
    """Return the text of a cell file: section -> option -> value."""
    content = {
        section: {
            key: str(value) if isinstance(value, Path) else value for key, value in values.items()
        }
        for section, values in given.items()
        if values
    }
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def _composed(text: str, start: Place) -> yaml.Node | None:
    loader = None
    try:
        loader = _CellLoader(text)
        return loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = start if mark is None else _place(mark, start.file)
        began = error.context_mark
        since = "" if began is None else f", begun in line {began.line + 1}"
        place.refuse(", ".join(filter(None, (error.context, error.problem))) + since)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        Place(file=start.file, line=line).refuse(f"a character is not taken: {error.reason}")
    except (ValueError, OverflowError) as error:
        # An escape such as \UFFFFFFFF stands for no character.
        line = 1 if loader is None else loader.line + 1
        Place(file=start.file, line=line).refuse(f"this is no YAML: {error}")


def _pairs(node: yaml.Node | None, file: str, what: str) -> Iterator[tuple[str, yaml.Node, Place]]:
    """Yield key, value and the key's place of a mapping."""
    if node is None or _is_empty(node):
        return
    if not isinstance(node, yaml.MappingNode):
        _place(node.start_mark, file).refuse(
            f"{what} is a mapping of names to values, as in `name: value`"
        )
    seen: dict[str, int] = {}
    for key, value in node.value:
        place = _place(key.start_mark, file)
        if not isinstance(key, yaml.ScalarNode):
            place.refuse("a name is one word")
        if key.value in seen:
            place.refuse(f"{key.value} stands in line {seen[key.value]} already")
        seen[key.value] = place.line
        yield key.value, value, place


def _value(node: yaml.Node, key: str, file: str) -> object:
    """Return the value of an option, as YAML 1.2 reads it: `control: off` is a word."""
    if isinstance(node, yaml.SequenceNode):
        return [_value(item, key, file) for item in node.value]
    place = _place(node.start_mark, file)
    if not isinstance(node, yaml.ScalarNode):
        place.refuse(f"{key} is an option and takes a value, not further names")
    text = str(node.value)
    if not text.isprintable():
        place.refuse(f"{key} has a character that no option takes, in {text[:40]!r}")
    if node.style is not None:
        return text
    if _is_empty(node):
        place.refuse(f"{key} has no value; leave it out, or give one")
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace(".", "", 1))
    if _WHOLE.fullmatch(text):
        if len(text) > _MOST_DIGITS:
            place.refuse(f"{key} has {len(text)} digits")
        return int(text)
    return float(text) if _NUMBER.fullmatch(text) else text


def _is_empty(node: yaml.Node) -> bool:
    plain = isinstance(node, yaml.ScalarNode) and node.style is None
    return plain and node.value.lower() in ("", "~", "null")


def _place(mark: yaml.Mark, file: str) -> Place:
    return Place(file=file, line=mark.line + 1, column=mark.column + 1)


def _check_name(key: str, section: str, known: Known, place: Place) -> None:
    """Refuse a name that is no option of a section, or no section where that is empty."""
    of_others = [other for other in known if other != section and key in known[other]]
    if key in known.get(section, known):
        return
    if of_others:
        place.refuse(f"{key} belongs below {of_others[0]}")
    if key in known:
        place.refuse(f"{key} is a section of its own: begin it at the left margin")
    owner = f"section {section}" if section else "a cell file"
    try:
        refuse_unknown([key], known.get(section, known), owner=owner)
    except ParameterError as error:
        place.refuse(error)
