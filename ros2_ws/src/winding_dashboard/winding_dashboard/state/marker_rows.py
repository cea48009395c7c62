"""The table of markers: predicted, corrected and measured curve lengths side by side."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from winding_core.markers import MarkerFlag, Markers

NAN = float("nan")
USUAL_MARKERS, MOST_MARKERS = 4, 8  # Rows from the start, and rows at most
# The gravest first.
_STATES = (
    (MarkerFlag.NOT_WOUND, "not wound"),
    (MarkerFlag.SLIPPED, "slipped"),
    (MarkerFlag.OCCLUDED, "hidden"),
    (MarkerFlag.CLIPPED, "cut off"),
    (MarkerFlag.PREDICTED, "out of sight"),
    (MarkerFlag.TOUCHING, "touching"),
)


@dataclass(frozen=True, kw_only=True)
class MarkerRow:
    """One marker."""

    id: int  # n of Pn
    ahead: float = NAN  # S_n that was predicted before the run [m]
    predicted: float = NAN  # S_n of the solver in step [m]
    corrected: float = NAN  # S_n of the correction [m]
    low: float = NAN  # Lower bound of it [m]
    high: float = NAN  # Upper bound of it [m]
    measured: float = NAN  # S_n of the tracker [m]
    state: str = "not wound"  # One word or two

    @property
    def difference(self) -> float:
        """(measured - corrected) / corrected; against the prediction where nothing corrects."""
        expected = self.predicted if math.isnan(self.corrected) else self.corrected
        return (self.measured - expected) / expected if expected else NAN


def marker_rows(
    *, ahead: Markers, predicted: Markers, corrected: Markers, tracked: Markers
) -> list[MarkerRow]:
    """Return a row for the usual markers and every other but P0 that a source names, by number."""
    sources = {
        "ahead": _column(ahead, "s"),
        "predicted": _column(predicted, "s"),
        "corrected": _column(corrected, "s"),
        "low": _column(corrected, "s_low"),
        "high": _column(corrected, "s_high"),
        "measured": _column(tracked, "s"),
    }
    states = {int(marker["id"]): _state(int(marker["flags"])) for marker in tracked}
    named = {number for found in sources.values() for number in found} | set(states)
    return [
        MarkerRow(
            id=number,
            **{name: found.get(number, NAN) for name, found in sources.items()},
            state=states.get(number, _unseen(sources, number)),
        )
        for number in sorted(named | set(range(1, USUAL_MARKERS + 1)))
        if 0 < number <= MOST_MARKERS
    ]


def _unseen(sources: Mapping[str, Mapping[int, float]], number: int) -> str:
    """Return the state of a marker that no camera speaks of."""
    return "not seen" if math.isfinite(sources["predicted"].get(number, NAN)) else "not wound"


def _column(markers: Markers, name: str) -> dict[int, float]:
    return {
        int(marker["id"]): float(marker[name])
        for marker in markers
        if not int(marker["flags"]) & MarkerFlag.NOT_WOUND and name in (markers.dtype.names or ())
    }


def _state(flags: int) -> str:
    return next((text for flag, text in _STATES if flags & flag), "measured")
