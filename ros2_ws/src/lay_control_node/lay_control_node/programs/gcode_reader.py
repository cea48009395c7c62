"""G-code of filament winding: X the carriage, A the mandrel's angle; the format only.

The carriage of such a program is taken for where the cable is wanted, because the programs know
neither a lag nor a stretch. Times and feed rates are ignored: the plan has its own.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from lay_control_node.programs.points import PointList
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.units import MILLIMETRE

Word = tuple[str, float]

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_WORD = re.compile(r"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?)\s*", re.ASCII)


def words_of(text: str, name: str) -> Iterator[tuple[int, list[Word]]]:
    """Yield the number of every line that is not empty, and its words.

    Raises:
        LayProgramError: A line is no G-code.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        rest = _COMMENT.sub("", line).strip().upper()
        # A percent sign marks begin and end of a tape; a line behind a slash may be left out.
        if rest == "%":
            continue
        if rest.startswith("/"):
            raise LayProgramError(
                f"line {number} of {name} may be left out (/): write it or leave it out"
            )
        words: list[Word] = []
        at = 0
        while at < len(rest):
            found = _WORD.match(rest, at)
            if found is None:
                raise LayProgramError(
                    f"line {number} of {name} is no G-code from {rest[at : at + 20]!r} on"
                )
            words.append((found[1], float(found[2])))
            at = found.end()
        words = [word for word in words if word[0] != "N"]
        if words:
            yield number, words


INCH = 25.4 * MILLIMETRE
_DEGREE = math.pi / 180.0
# Planes, compensation off, a coordinate system, path modes, feed modes: nothing moves by them.
_WITHOUT_EFFECT = {17.0, 18.0, 19.0, 40.0, 49.0, 54.0, 61.0, 64.0, 80.0, 93.0, 94.0, 95.0}
_ENDS = {2.0, 30.0}
# Letters of which nothing is used, and what they stand for.
_IGNORED = {"B": "the head B", "C": "the axis C", "E": "the extruder E", "F": "feed rates F",
            "S": "speeds S", "T": "tools T", "P": "pauses P"}  # fmt: skip
_TINY = 1.0e-9


@dataclass(kw_only=True)
class _Machine:
    """Where the program has taken the axes X [m] and A [rad], and its modes."""

    # By axis: its place, where the program's zero lies, and one of the program's units in SI.
    at: dict[str, float] = field(default_factory=lambda: {"X": 0.0, "A": 0.0})
    zero: dict[str, float] = field(default_factory=lambda: {"X": 0.0, "A": 0.0})
    unit: dict[str, float] = field(default_factory=lambda: {"X": MILLIMETRE, "A": _DEGREE})
    absolute: bool = True  # Whether places are counted from that zero
    moving: bool = False  # Whether G0 or G1 has been read
    ignored: Counter[str] = field(default_factory=Counter)  # What is not used


def parse_gcode(text: str, *, radius: float, name: str) -> LayProgram:
    """Read G0 and G1 moves of X and A, absolute or relative, in millimetres or inches.

    The program begins where the mandrel first turns; the direction of that turn is the winding's.

    Args:
        text: The program.
        radius: Of the laid cable's centreline [m].
        name: Of the program.

    Raises:
        LayProgramError: A line asks for what is not read, or for cable that cannot lie so.
    """
    machine = _Machine()
    points = PointList(radius=radius)
    sense, start = 0.0, (0.0, 0.0)
    remarks = []
    for number, words in words_of(text, name):
        place = f"line {number} of {name}"
        x, a = machine.at["X"], machine.at["A"]
        if _take(machine, words, place):
            break
        turned, went = machine.at["A"] - a, machine.at["X"] - x
        if abs(turned) <= _TINY:
            if abs(went) > _TINY and sense:
                raise LayProgramError(
                    f"{place}: the carriage moves while the mandrel stands "
                    f"({went / MILLIMETRE:.4g} mm): no cable lies so"
                )
            continue
        if not sense:
            sense, start = math.copysign(1.0, turned), (x, a)
            points.add(0.0, 0.0, math.nan, place)
            if sense < 0.0:
                remarks.append("A descends: the winding is read in that direction")
            if abs(x) > _TINY:
                remarks.append(
                    f"z is counted from X {x / MILLIMETRE:.4g} mm, where the mandrel first turns"
                )
        if turned * sense < 0.0:
            raise LayProgramError(
                f"{place}: the mandrel turns back by {abs(turned) / _DEGREE:.4g} degrees"
            )
        z = machine.at["X"] - start[0]
        points.add(sense * (machine.at["A"] - start[1]), z, math.nan, place)
    if not sense:
        raise LayProgramError(f"{name} never turns the mandrel (A)")
    if machine.ignored:
        ignored = ", ".join(
            f"{what} ({count} x)" for what, count in sorted(machine.ignored.items())
        )
        remarks.append(f"ignored: {ignored}")
    return points.program(name, remarks)


def _take(machine: _Machine, words: list[Word], place: str) -> bool:
    """Execute a line; return whether the program ends."""
    axes: dict[str, float] = {}
    sets_place = False
    for letter, value in words:
        if letter == "G":
            sets_place = _mode(machine, value, place) or sets_place
        elif letter == "M":
            if value in _ENDS:
                return True
            machine.ignored[f"M{value:g}"] += 1
        elif letter in "XA":
            if letter in axes:
                raise LayProgramError(f"{place} has {letter} twice")
            axes[letter] = value
        elif letter in _IGNORED:
            machine.ignored[_IGNORED[letter]] += 1
        else:
            raise LayProgramError(
                f"{place} has {letter}{value:g}; X is the carriage and A the mandrel's angle, "
                "B may turn the head, and nothing else is read"
            )
    if sets_place:
        for axis, value in axes.items():
            machine.zero[axis] = machine.at[axis] - machine.unit[axis] * value
    elif axes:
        _move(machine, axes, place)
    return False


def _mode(machine: _Machine, code: float, place: str) -> bool:
    """Take a G word; return whether it sets the place (G92)."""
    if code in (0.0, 1.0):
        machine.moving = True
    elif code in (20.0, 21.0):
        machine.unit["X"] = INCH if code == 20.0 else MILLIMETRE
    elif code in (90.0, 91.0):
        machine.absolute = code == 90.0
    elif code == 92.0:
        return True
    elif code == 4.0:
        machine.ignored["pauses G4"] += 1
    elif code not in _WITHOUT_EFFECT:
        raise LayProgramError(f"{place} has G{code:g}; read are G0, G1, G20, G21, G90, G91 and G92")
    return False


def _move(machine: _Machine, axes: dict[str, float], place: str) -> None:
    if not machine.moving:
        raise LayProgramError(f"{place} moves before any G0 or G1")
    base = machine.zero if machine.absolute else machine.at
    for axis, value in axes.items():
        machine.at[axis] = base[axis] + machine.unit[axis] * value
    if not all(map(math.isfinite, machine.at.values())):
        raise LayProgramError(f"{place} moves beyond any number")
