"""Wanted, predicted and measured lay over turns, and beneath it how far off they lie."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.errors import FIRST_JUDGED, FULL_TURN, lay_errors
from winding_core.lay.records import cable_lay
from winding_core.units import MILLIMETRE
from winding_dashboard.drawings.axis_ticks import ticks
from winding_dashboard.drawings.line_chart import Band, Curve, Ends, chart, ends_of
from winding_dashboard.state.view_state import ViewState

Array = NDArray[np.float64]
Points = list[list[float | None]]

# The newest turns are drawn, and of each so many points at most.
TURNS, _POINTS_OF_A_TURN = 12, 36
# The upper vertical axis holds at least this [mm], the lower one this in tolerances.
_LEAST_Z, _SEEN_TOLERANCES = 5.0, 1.2
_NOISE = 0.1
_UPPER, _LOWER = (660.0, 200.0), (660.0, 150.0)


def control_drawings(state: ViewState, tolerance: float) -> dict[str, str]:
    """Return the lay and its deviation, one above the other on one axis of turns.

    Args:
        state: With a controller that is known.
        tolerance: Half width of the band [m].

    Returns:
        The insides of two SVG elements by their ids.
    """
    wound = state.control.wanted.end / FULL_TURN
    last = max(1, math.ceil(wound - 1.0e-6))
    first = max(0, last - TURNS)
    curves = {name: _within(points, first) for name, points in lay_curves(state).items()}
    limit = tolerance / MILLIMETRE
    band = _SEEN_TOLERANCES * limit
    lay = [
        Curve(points=curves["wanted"], style="is-set dashed"),
        Curve(points=curves["predicted"], style="is-predicted"),
        Curve(points=curves["measured"], style="is-measured", dots=True),
    ]
    off = [
        Curve(points=curves["predicted off"], style="is-predicted"),
        Curve(points=curves["measured off"], style="is-measured", dots=True),
    ]
    z = [y for curve in lay for _, y in curve.points if y is not None] or [0.0]
    # What is missing behind P0 is no reason for an axis below zero.
    bottom = min(z) if min(z) < -_NOISE * max(z) else 0.0
    across = Ends(float(first), float(last), float(math.ceil((last - first) / TURNS)))
    begin = max(first, FIRST_JUDGED - 1)
    return {
        "chart-lay": chart(lay, across, Ends(*ticks(bottom, max(z), _LEAST_Z)), size=_UPPER),
        "chart-off": chart(
            off,
            across,
            ends_of(off, 0.0, -band, band),
            size=_LOWER,
            bands=[Band(x=(begin, last), y=(-limit, limit))] if begin < last else [],
        ),
    }


def lay_curves(state: ViewState) -> dict[str, Points]:
    """Return [turns, mm] of every curve by its name."""
    control, wanted = state.control, state.control.wanted
    angle, radius = state.drum_angle, state.centreline_radius
    theta, z = np.zeros(0), np.zeros(0)
    if math.isfinite(angle) and math.isfinite(radius):
        theta, z = cable_lay(state.cable, angle, radius)
    places = state.lay
    return {
        "wanted": _points(wanted.theta, wanted.z) if control.known else [],
        "predicted": _points(theta, z),
        "measured": _points(places["theta"], places["z"]),
        "predicted off": _points(theta, z - wanted.at(theta)),
        "measured off": _points(places["theta"], lay_errors(places, wanted)),
    }


def _points(theta: NDArray[Any], z: NDArray[Any]) -> Points:
    """Return [turns, mm] of what is known, thinned where it is dense."""
    turns, height = np.asarray(theta, float) / FULL_TURN, np.asarray(z, float) / MILLIMETRE
    known = np.isfinite(turns) & np.isfinite(height)
    turns, height = turns[known], height[known]
    if turns.size:
        span = max(float(np.ptp(turns)), 1.0)
        every = math.ceil(turns.size / (_POINTS_OF_A_TURN * span))
        turns, height = turns[::every], height[::every]
    return [[x, y] for x, y in zip(turns.round(3).tolist(), height.round(3).tolist(), strict=True)]


def _within(points: Points, first: float) -> Points:
    return [point for point in points if point[0] is not None and point[0] >= first]
