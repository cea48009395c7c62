"""Lay programs as YAML: points, pieces in words, pull and markers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from lay_control_node.programs.points import ANGLES, TENSION, Columns, PointList, finite_number
from lay_control_node.programs.segments import SEGMENTS, add_segment
from lay_control_node.programs.simple_programs import with_markers_every_turn
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.yaml_text import YamlTextError, load_yaml

_WORDS = ("name", "points", "segments", TENSION, "markers")
EVERY_TURN = "every_turn"


def parse_yaml(text: str, *, radius: float, name: str) -> LayProgram:
    """Read a program of points, then segments, with markers.

    Args:
        text: The document.
        radius: Of the laid cable's centreline [m].
        name: Of the program where the document has none.

    Raises:
        LayProgramError: It cannot be used; says where.
    """
    try:
        content = load_yaml(text)
    except YamlTextError as error:
        raise LayProgramError(f"{name} is no YAML: {error}") from error
    if not isinstance(content, dict):
        raise LayProgramError(f"{name} must hold a mapping with points or segments")
    for word in content:
        if word not in _WORDS:
            raise LayProgramError(
                f"{name} holds {str(word)[:40]!r}; it may hold {', '.join(_WORDS)}"
            )
    if "points" not in content and "segments" not in content:
        raise LayProgramError(f"{name} holds neither points nor segments")
    tension = math.nan
    if TENSION in content:
        tension = finite_number(content[TENSION], f"{name}: {TENSION}")
    points = PointList(radius=radius)
    _add_points(points, content.get("points"), tension, name)
    _add_segments(points, content.get("segments"), tension, name)
    title = content.get("name", name)
    if not isinstance(title, str) or len(title) > 200:
        raise LayProgramError(f"{name}: name must be a text of at most 200 characters")
    return _with_markers(points, content.get("markers"), title, name)


def _add_points(points: PointList, rows: object, tension: float, name: str) -> None:
    if rows is None:
        points.add(0.0, 0.0, tension, name)
        return
    if not isinstance(rows, list) or not rows:
        raise LayProgramError(f"{name}: points must be a list with one mapping for each point")
    for k, row in enumerate(rows, start=1):
        place = f"{name}, point {k}"
        if not isinstance(row, dict) or not all(isinstance(key, str) for key in row):
            raise LayProgramError(f"{place} must be a mapping such as {{turns: 1, z_mm: 18}}")
        cells: dict[str, object] = {TENSION: None if math.isnan(tension) else tension, **row}
        points.add_row(Columns.of(row, place), cells, place)


def _add_segments(points: PointList, segments: object, tension: float, name: str) -> None:
    if segments is None:
        return
    if not isinstance(segments, list) or not segments:
        raise LayProgramError(f"{name}: segments must be a list of {', '.join(SEGMENTS)}")
    for k, segment in enumerate(segments, start=1):
        place = f"{name}, segment {k}"
        if not isinstance(segment, dict):
            raise LayProgramError(f"{place} must be a mapping, one of {', '.join(SEGMENTS)}")
        own = tension
        if TENSION in segment:
            own = finite_number(segment[TENSION], f"{place}: {TENSION}")
        words = [word for word in segment if word != TENSION]
        if len(words) != 1:
            raise LayProgramError(
                f"{place} must be one of {', '.join(SEGMENTS)}, it holds {len(words)} of them"
            )
        add_segment(points, str(words[0]), segment[words[0]], own, place)


def _with_markers(points: PointList, markers: Any, title: str, name: str) -> LayProgram:
    program = points.program(title)
    if markers is None:
        return program
    if markers == EVERY_TURN:
        return with_markers_every_turn(program)
    if not isinstance(markers, Mapping) or len(markers) != 1 or next(iter(markers)) not in ANGLES:
        raise LayProgramError(
            f"{name}: markers must be {EVERY_TURN}, or angles by number below one of "
            f"{', '.join(ANGLES)}"
        )
    unit, by_number = next(iter(markers.items()))
    if not isinstance(by_number, Mapping):
        raise LayProgramError(f"{name}: markers: {unit} must hold an angle for each marker")
    found = dict(program.markers)
    for number, angle in by_number.items():
        if isinstance(number, bool) or not isinstance(number, int):
            raise LayProgramError(f"{name}: markers are whole numbers, got {str(number)[:40]!r}")
        if number in found:
            raise LayProgramError(f"{name}: marker {number} is there twice")
        found[number] = ANGLES[unit] * finite_number(angle, f"{name}: marker {number}")
    return dataclasses.replace(program, markers=found)
