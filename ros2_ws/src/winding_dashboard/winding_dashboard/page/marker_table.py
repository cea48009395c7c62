"""The table of markers in words."""

from __future__ import annotations

from dataclasses import dataclass

from winding_dashboard.page.figures import OLD
from winding_dashboard.page.numbers import DASH, PER_METRE, number
from winding_dashboard.state.marker_rows import MarkerRow
from winding_dashboard.state.view_state import ViewState

_FEWEST_ROWS = 4


@dataclass(frozen=True, kw_only=True)
class MarkerLine:
    """One marker's row; lengths in millimetres.

    Attributes:
        name: Pn.
        ahead: Predicted before the run.
        predicted: By the solver in step.
        corrected: By the correction.
        bounds: Of that.
        measured: By the tracker.
        difference: Of measured and corrected, in percent.
        state: One word or two.
    """

    name: str
    ahead: str
    predicted: str
    corrected: str
    bounds: str
    measured: str
    difference: str
    state: str


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
