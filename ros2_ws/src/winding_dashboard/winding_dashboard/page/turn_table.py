"""The newest turns of a wanted lay in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from winding_core.lay.errors import TurnError, turn_state
from winding_dashboard.page.numbers import PER_METRE, number

# The newest turns stand in the table.
_ROWS = 6
_STYLES = {"off": "bad", "partly seen": "warn"}


@dataclass(frozen=True, kw_only=True)
class TurnLine:
    """One turn's row.

    Attributes:
        cells: Number, and lengths in millimetres.
        state: How the turn lies, in a word or two.
        style: Of that.
    """

    cells: tuple[str, ...]
    state: str
    style: str


def turn_lines(turns: Sequence[TurnError], tolerance: float) -> list[TurnLine]:
    """Return a row for each of the newest turns, held against a tolerance [m]."""
    return [_line(turn, tolerance) for turn in turns[-_ROWS:]]


def _line(turn: TurnError, tolerance: float) -> TurnLine:
    state = turn_state(turn, tolerance)
    return TurnLine(
        cells=(
            str(turn.number),
            number(turn.wanted_z, 2, PER_METRE),
            number(turn.measured_z, 2, PER_METRE),
            number(turn.mean, 2, PER_METRE, sign=True),
            number(turn.largest, 2, PER_METRE, sign=True),
        ),
        state=state,
        style=_STYLES.get(state, "quiet"),
    )
