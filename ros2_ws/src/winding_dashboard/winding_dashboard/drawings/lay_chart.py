"""The measured lay of every turn against the commanded helix."""

from __future__ import annotations

import math

import numpy as np

from winding_core.lay.records import LayFlag, LayRecords, name_of
from winding_core.units import MILLIMETRE
from winding_dashboard.drawings.line_chart import Curve, Ends, chart, ends_of

# The vertical axis holds at least this [mm].
_LEAST_ERROR = 0.5
_SIZE, _MOST_TICKS = (660.0, 150.0), 12


def lay_errors(records: LayRecords, advance: float) -> list[list[float]]:
    """Return [wound turns, distance from the helix of an advance [m/rad], in mm] of every place."""
    error = (records["z"] - advance * records["theta"]) / MILLIMETRE
    turns = records["theta"] / math.tau
    known = np.isfinite(error)
    return [
        [float(turn), float(off)]
        for turn, off in zip(turns[known].round(3), error[known].round(3), strict=True)
    ]


def lay_drawing(records: LayRecords, advance: float) -> str:
    """Return a chart of the distance of every place from the helix of an advance [m/rad]."""
    errors = lay_errors(records, advance) if math.isfinite(advance) else []
    curve = Curve(points=errors, style="is-measured", dots=True)
    turns = [turn for turn, _ in errors] or [0.0, 1.0]
    low, high = math.floor(min(turns)), max(math.ceil(max(turns)), math.floor(min(turns)) + 1)
    across = Ends(float(low), float(high), float(math.ceil((high - low) / _MOST_TICKS)))
    up = ends_of([curve], 0.0, -_LEAST_ERROR, _LEAST_ERROR)
    return chart([curve], across, up, size=_SIZE)


def defects_told(records: LayRecords) -> str:
    """Return which defects are among the records, and on which turns."""
    told = []
    for flag in LayFlag:
        turns = np.unique(records["turn"][(records["flags"] & flag) > 0]).tolist()
        if turns:
            told.append(f"{name_of(flag)} on turn {', '.join(str(turn + 1) for turn in turns)}")
    return "; ".join(told)
