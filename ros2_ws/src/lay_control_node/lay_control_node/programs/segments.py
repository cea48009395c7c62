"""Pieces of a program in words: helix, dwell, turns between two flanges, a swinging pitch."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from lay_control_node.programs.points import FULL_TURN, MOST_TURNS, PointList, finite_number
from winding_core.lay.program import LayProgramError
from winding_core.units import MILLIMETRE

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
    str,
    tuple[tuple[str, ...], Callable[[PointList, Mapping[str, object], float, str], None]],
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
