"""Lay programs as YAML: points, pieces in words, pull and markers."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

from lay_control_node.programs.points import (
    ANGLES,
    FULL_TURN,
    MOST_TURNS,
    TENSION,
    Columns,
    PointList,
    finite_number,
)
from lay_control_node.programs.simple_programs import with_markers_every_turn
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.units import MILLIMETRE
from winding_core.yaml_text import YamlTextError, load_yaml

# Straight pieces of a swinging pitch: they leave the curve by A (2 pi / n)^2 / 8, which is
# 2e-4 of the amplitude A of z.
COSINE_PIECES = 180
_TINY = 1.0e-12

Values = Mapping[str, float]


def add_segment(points: PointList, word: str, content: object, tension: float, place: str) -> None:
    """Add a piece behind the points so far.

    Args:
        points: So far; at least P0.
        word: One of SEGMENTS.
        content: Its numbers by name.
        tension: Pull along it [N]; nan for the condition's.
        place: Of the piece, for a refusal.

    Raises:
        LayProgramError: The piece is unknown, or a number is missing or out of range.
    """
    if word not in SEGMENTS:
        raise LayProgramError(f"{place}: a segment is one of {', '.join(SEGMENTS)}, got {word!r}")
    names, add = SEGMENTS[word]
    place = f"{place}: {word}"
    if not isinstance(content, Mapping):
        raise LayProgramError(f"{place} needs {', '.join(names)}")
    for name in content:
        if name not in names:
            raise LayProgramError(f"{place} takes {', '.join(names)}, got {str(name)[:40]!r}")
    missing = [name for name in names if name not in content]
    if missing:
        raise LayProgramError(f"{place} needs {', '.join(missing)}")
    # The new pull holds from the point at which the piece begins.
    points.tension[-1] = tension
    add(points, content, tension, place)


def _helix(points: PointList, content: Mapping[str, object], tension: float, place: str) -> None:
    turns, pitch = _turns(content, place), _millimetres(content, "pitch_mm", place)
    points.add(points.theta[-1] + FULL_TURN * turns, points.z[-1] + pitch * turns, tension, place)


def _dwell(points: PointList, content: Mapping[str, object], tension: float, place: str) -> None:
    turns = _turns(content, place)
    points.add(points.theta[-1] + FULL_TURN * turns, points.z[-1], tension, place)


def _cosine(points: PointList, content: Mapping[str, object], tension: float, place: str) -> None:
    turns = _turns(content, place)
    mean = _millimetres(content, "mean_pitch_mm", place)
    swing = _millimetres(content, "amplitude_mm", place)
    period = finite_number(content["period_turns"], f"{place}: period_turns")
    if not period >= 0.01:
        raise LayProgramError(f"{place}: period_turns must be at least 0.01, got {period:g}")
    start, z = points.theta[-1], points.z[-1]
    count = math.ceil(COSINE_PIECES * turns / period)
    for k in range(1, count + 1):
        u = turns * k / count
        wave = swing * period / FULL_TURN * math.sin(FULL_TURN * u / period)
        points.add(start + FULL_TURN * u, z + mean * u + wave, tension, place)


def _reverse_at(
    points: PointList, content: Mapping[str, object], tension: float, place: str
) -> None:
    turns, pitch = _turns(content, place), _millimetres(content, "pitch_mm", place)
    flanges = content["z_mm"]
    if not isinstance(flanges, list) or len(flanges) != 2:
        raise LayProgramError(f"{place}: z_mm must be two numbers, the lower flange first")
    low, high = (MILLIMETRE * finite_number(item, f"{place}: z_mm") for item in flanges)
    z = points.z[-1]
    if not low < high or not low <= z <= high:
        raise LayProgramError(
            f"{place}: the flanges must ascend and hold the {z / MILLIMETRE:g} mm where the cable "
            f"lies, got {low / MILLIMETRE:g} to {high / MILLIMETRE:g} mm"
        )
    if pitch == 0.0:
        raise LayProgramError(f"{place}: pitch_mm must not be 0, no flange is ever reached")
    left = turns
    while left > _TINY * turns:
        flange = high if pitch > 0.0 else low
        step = min(left, (flange - points.z[-1]) / pitch)
        if step > _TINY * turns:
            at_flange = step < left
            z = flange if at_flange else points.z[-1] + pitch * step
            points.add(points.theta[-1] + FULL_TURN * step, z, tension, place)
            left -= step
        pitch = -pitch


SEGMENTS: dict[
    str, tuple[tuple[str, ...], Callable[[PointList, Mapping[str, object], float, str], None]]
] = {
    "helix": (("pitch_mm", "turns"), _helix),
    "dwell": (("turns",), _dwell),
    "reverse_at": (("z_mm", "pitch_mm", "turns"), _reverse_at),
    "cosine": (("mean_pitch_mm", "amplitude_mm", "period_turns", "turns"), _cosine),
}


def _turns(content: Mapping[str, object], place: str) -> float:
    turns = finite_number(content["turns"], f"{place}: turns")
    if not 0.0 < turns <= MOST_TURNS:
        raise LayProgramError(
            f"{place}: turns must lie above 0 and up to {MOST_TURNS:g}, got {turns:g}"
        )
    return turns


def _millimetres(content: Mapping[str, object], name: str, place: str) -> float:
    return MILLIMETRE * finite_number(content[name], f"{place}: {name}")


_WORDS = ("name", "points", "segments", TENSION, "markers")
EVERY_TURN = "every_turn"


def parse_yaml(text: str, *, radius: float, name: str) -> LayProgram:
    """Read a program of points, then segments, with markers.

    Args:
        text: The document.
        radius: Of the laid cable's centreline [m].
        name: Of the program where the document has none.

    Raises:
        LayProgramError: It cannot be used; the message contains where.
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
