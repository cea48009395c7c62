"""A lay held against a tolerance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from winding_core.lay_errors import FULL_TURN, TurnError
from winding_core.parameters import parameter
from winding_core.units import LENGTH, MILLIMETRE

# In the first turns the guide still gets ahead of the cable.
FIRST_JUDGED = 3
_STARTING_TURNS = "turns 1 and 2, in which the guide gets ahead, are not judged"


@dataclass(frozen=True, kw_only=True)
class LayTolerance:
    """How far from the wanted lay a turn may lie."""

    lay_tolerance: float = parameter(
        0.5e-3,
        "largest distance from the wanted lay that is allowed in every turn after the second",
        LENGTH,
        1.0e-5,
        0.1,
        read_only=False,
    )


@dataclass(frozen=True, kw_only=True)
class LayVerdict:
    """Whether a lay keeps its tolerance.

    Attributes:
        tolerance: [m]
        kept: None where that cannot be said.
        sentence: What was found.
        worst: The turn that lies farthest off among those that are judged; None without any.
    """

    tolerance: float
    kept: bool | None
    sentence: str
    worst: TurnError | None = None


def judge(turns: Sequence[TurnError], tolerance: float, wound: float) -> LayVerdict:
    """Return whether every turn after the second lies within a tolerance.

    Args:
        turns: What was measured.
        tolerance: [m]
        wound: Wound angle at the end of the run [rad].
    """
    limit = f"{tolerance / MILLIMETRE:g} mm"
    judged = [turn for turn in turns if turn.number >= FIRST_JUDGED]
    whole = {turn.number for turn in judged if turn.whole}
    last = max([math.floor(wound / FULL_TURN), *(turn.number for turn in judged)])
    missing = [number for number in range(FIRST_JUDGED, last + 1) if number not in whole]
    if not judged:
        return LayVerdict(
            tolerance=tolerance,
            kept=None,
            sentence=f"the lay cannot be held against {limit}: "
            f"{'nothing of it' if missing else 'no turn after the second'} was measured",
        )
    worst = max(judged, key=lambda turn: abs(turn.largest))
    found = f"at most {abs(worst.largest) / MILLIMETRE:.2f} mm off, in turn {worst.number}"
    if abs(worst.largest) > tolerance:
        kept, said = False, f"the lay does not keep {limit}: {found}"
    elif missing:
        kept = None
        said = (
            f"the lay cannot be held against {limit}: {_numbers(missing)} "
            f"{'was' if len(missing) == 1 else 'were'} not measured all round; else {found}"
        )
    else:
        turns_judged = _numbers(range(FIRST_JUDGED, last + 1))
        kept, said = True, f"the lay keeps {limit} in {turns_judged}: {found}"
    return LayVerdict(
        tolerance=tolerance, kept=kept, sentence=f"{said}; {_STARTING_TURNS}", worst=worst
    )


def turn_state(turn: TurnError, tolerance: float) -> str:
    """Return in a word or two how a turn lies against a tolerance [m]."""
    if turn.number < FIRST_JUDGED:
        return "not judged"
    if abs(turn.largest) > tolerance:
        return "off"
    return "within" if turn.whole else "partly seen"


def _numbers(turns: Sequence[int]) -> str:
    """Return turns as people name them: turn 3, turns 3 to 6, turns 3, 5 and 6."""
    first, last = turns[0], turns[-1]
    if len(turns) == 1:
        return f"turn {first}"
    if last - first == len(turns) - 1:
        return f"turns {first} {'and' if len(turns) == 2 else 'to'} {last}"
    return f"turns {', '.join(map(str, turns[:-1]))} and {last}"
