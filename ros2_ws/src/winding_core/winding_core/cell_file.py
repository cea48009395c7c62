"""A cell file: YAML that describes a run, read with the place of every value."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import yaml

from winding_core.yaml_text import MOST_CHARACTERS, PlainLoader

# Sections, options, numbers of a list; a text of brackets alone would exhaust the interpreter.
_DEEPEST = 4
# Longer whole numbers are no value of any option, and Python does not read them.
_MOST_DIGITS = 400
_WHOLE = re.compile(r"[-+]?[0-9]+")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
# As YAML 1.2 has them: `control: off` is a word.
_WORDS = {
    word: value
    for name, value in (("true", True), ("false", False), ("null", None))
    for word in (name, name.capitalize(), name.upper())
} | {"": None, "~": None}


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
    values: Mapping[str, object] = field(default_factory=dict)  # By option
    places: Mapping[str, Place] = field(default_factory=dict)  # Of options
    sections: Mapping[str, Place] = field(default_factory=dict)  # Of the sections' names


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


def read_cell(path: Path, known: Mapping[str, Mapping[str, object]]) -> CellFile:
    """Return what a cell file states.

    Args:
        path: The file.
        known: Section -> the names of its options.

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


def parse_cell(text: str, start: Place, known: Mapping[str, Mapping[str, object]]) -> CellFile:
    """Return what the text of a cell file states; see `read_cell`."""
    values: dict[str, object] = {}
    places: dict[str, Place] = {}
    sections: dict[str, Place] = {}
    for name, node, place in _pairs(_composed(text, start), start.file, "a cell file"):
        sections[name] = place
        if name not in known:
            place.refuse(_unknown_section(name, known))
        if _is_empty(node):
            continue
        for key, value, at in _pairs(node, start.file, f"section {name}"):
            if key not in known[name]:
                at.refuse(_unknown_key(key, name, known))
            places[key] = _place(value, start.file)
            values[key] = _value(value, key, start.file)
    return CellFile(start=start, values=values, places=places, sections=sections)


def cell_text(given: Mapping[str, Mapping[str, object]]) -> str:
    """Return the text of a cell file.

    Args:
        given: Section -> option -> value.
    """
    content = {section: dict(values) for section, values in given.items() if values}
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def _composed(text: str, start: Place) -> yaml.Node | None:
    loader = None
    try:
        loader = _CellLoader(text)
        return loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = start if mark is None else _marked(mark, start.file)
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
    if node is None:
        return
    if not isinstance(node, yaml.MappingNode):
        _place(node, file).refuse(f"{what} is a mapping of names to values, as in `name: value`")
    seen: dict[str, int] = {}
    for key, value in node.value:
        place = _place(key, file)
        if not isinstance(key, yaml.ScalarNode):
            place.refuse("a name is one word")
        if key.value in seen:
            place.refuse(f"{_shown(key.value)} stands in line {seen[key.value]} already")
        seen[key.value] = place.line
        yield key.value, value, place


def _value(node: yaml.Node, key: str, file: str) -> object:
    if isinstance(node, yaml.SequenceNode):
        return [_value(item, key, file) for item in node.value]
    if not isinstance(node, yaml.ScalarNode):
        _place(node, file).refuse(f"{key} is an option and takes a value, not further names")
    if node.style is not None:
        return str(node.value)
    return _plain(node, key, file)


def _plain(node: yaml.ScalarNode, key: str, file: str) -> object:
    text = str(node.value)
    if _is_empty(node):
        _place(node, file).refuse(f"{key} has no value; leave it out, or give one")
    if text in _WORDS:
        return _WORDS[text]
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace(".", "", 1))
    if _WHOLE.fullmatch(text):
        if len(text) > _MOST_DIGITS:
            _place(node, file).refuse(f"{key} has {len(text)} digits")
        return int(text)
    return float(text) if _NUMBER.fullmatch(text) else text


def _is_empty(node: yaml.Node) -> bool:
    plain = isinstance(node, yaml.ScalarNode) and node.style is None
    return plain and _WORDS.get(node.value, "") is None


def _place(node: yaml.Node, file: str) -> Place:
    return _marked(node.start_mark, file)


def _marked(mark: yaml.Mark, file: str) -> Place:
    return Place(file=file, line=mark.line + 1, column=mark.column + 1)


def _unknown_section(name: str, known: Mapping[str, Mapping[str, object]]) -> str:
    for section, keys in known.items():
        if name in keys:
            return f"{name} belongs below {section}"
    return f"a cell file has no section {_shown(name)}{_nearest(name, known, 0.0)}"


def _unknown_key(key: str, section: str, known: Mapping[str, Mapping[str, object]]) -> str:
    for other, keys in known.items():
        if key in keys:
            return f"{key} belongs below {other}, not below {section}"
    if key in known:
        return f"{key} is a section of its own: begin it at the left margin"
    hint = _nearest(key, known[section], 0.6)
    if not hint:
        everywhere = {name: other for other, names in known.items() for name in names}
        hint = _nearest(key, everywhere, 0.6) or _nearest(key, known[section], 0.0)
    return f"section {section} has no option {_shown(key)}{hint}"


def _nearest(word: str, known: Mapping[str, object], cutoff: float) -> str:
    near = difflib.get_close_matches(word[:80], sorted(known), n=1, cutoff=cutoff)
    if not near:
        return ""
    section = known[near[0]]
    below = f" below {section}" if isinstance(section, str) else ""
    return f"; did you mean {near[0]}{below}?"


def _shown(word: str) -> str:
    return word if word.isidentifier() and len(word) <= 80 else f"{word[:80]!r}"
