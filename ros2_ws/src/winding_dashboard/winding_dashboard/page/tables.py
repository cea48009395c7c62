"""The tables of markers and of nodes as rows of text, and the warnings beside Start."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.status import Level
from winding_dashboard.page.figures import OLD
from winding_dashboard.page.numbers import DASH, PER_METRE, number
from winding_dashboard.state.health import Health
from winding_dashboard.state.marker_rows import MarkerRow
from winding_dashboard.state.view_state import ViewState

_MOST = 12
_LEVELS = {
    Level.OK: ("ok", "quiet"),
    Level.WARN: ("warning", "warn"),
    Level.ERROR: ("ERROR", "bad"),
    Level.STALE: ("silent", "warn"),
}
_FEWEST_ROWS = 4


@dataclass(frozen=True, kw_only=True)
class NodeLine:
    """One node's row."""

    name: str  # Of the node
    lifecycle: str  # State of it, or a dash
    level: str  # In a word
    style: str  # Of that word
    message: str  # Its message in /diagnostics


def node_lines(health: Health, now: float) -> list[NodeLine]:
    """Return a row for every node at wall time now [s]."""
    return [
        NodeLine(
            name=row.name,
            lifecycle=row.lifecycle or DASH,
            level=_LEVELS[row.level][0],
            style=_LEVELS[row.level][1],
            message=row.message,
        )
        for row in health.rows(now)[:_MOST]
    ]


def active_warnings(health: Health, now: float) -> list[tuple[str, str]]:
    """Return style and sentence of every node that warns, at wall time now [s].

    A node that was never heard is no warning: a played bag has no machine.
    """
    return [
        (_LEVELS[row.level][1], f"{row.name}: {row.message}")
        for row in health.rows(now)
        if row.level in (Level.WARN, Level.ERROR)
        or (row.level is Level.STALE and math.isfinite(health.silent_for(row.name, now)))
    ]


@dataclass(frozen=True, kw_only=True)
class MarkerLine:
    """One marker's row; lengths in millimetres."""

    name: str  # Pn
    ahead: str  # Predicted before the run
    predicted: str  # By the solver in step
    corrected: str  # By the correction
    bounds: str  # Of that
    measured: str  # By the tracker
    difference: str  # Of measured and corrected, in percent
    state: str  # One word or two


def marker_lines(state: ViewState) -> list[MarkerLine]:
    """Return a row for every marker; the usual four from the start."""
    rows = state.marker_rows()
    known = {row.id for row in rows}
    rows += [MarkerRow(id=n) for n in range(1, _FEWEST_ROWS + 1) if n not in known]
    return [_line(row) for row in sorted(rows, key=lambda row: row.id)]


def old_columns(state: ViewState) -> dict[str, float]:
    """Return which columns are no longer of the present, with their ages [s]."""
    sources = {"predicted": "predicted", "corrected": "corrected", "tracked": "measured"}
    return {
        column: state.behind(source)
        for source, column in sources.items()
        if state.behind(source) > OLD
    }


def _line(row: MarkerRow) -> MarkerLine:
    low, high = number(row.low, 1, PER_METRE), number(row.high, 1, PER_METRE)
    difference = number(row.difference, 2, 100.0, sign=True)
    return MarkerLine(
        name=f"P{row.id}",
        ahead=number(row.ahead, 1, PER_METRE),
        predicted=number(row.predicted, 2, PER_METRE),
        corrected=number(row.corrected, 2, PER_METRE),
        bounds="" if low == DASH else f"{low}–{high}",
        measured=number(row.measured, 2, PER_METRE),
        difference="" if difference == DASH else f"{difference} %",
        state=row.state,
    )
