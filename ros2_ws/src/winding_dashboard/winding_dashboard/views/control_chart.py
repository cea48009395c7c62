"""Wanted, predicted and measured lay over turns, and beneath it how far off they lie."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from nicegui import ui
from numpy.typing import NDArray

from winding_core.cable_lay import cable_lay
from winding_core.lay_errors import FULL_TURN, lay_errors
from winding_core.lay_tolerance import FIRST_JUDGED
from winding_core.units import MILLIMETRE
from winding_dashboard.views.axis_ticks import ticks
from winding_dashboard.views.palette import CORRECTED, FONT, LINE, MEASURED, PREDICTED, SOFT
from winding_dashboard.views.view_state import ViewState

Array = NDArray[np.float64]
Points = list[list[float]]

# The newest turns are drawn, and of each so many points at most.
TURNS, _POINTS_OF_A_TURN = 12, 36
# The upper vertical axis holds at least this [mm], the lower one this in tolerances.
_LEAST_Z, _SEEN_TOLERANCES = 5.0, 1.2
_NOISE = 0.1
_WANTED, _PREDICTED_NAME, _MEASURED_NAME = "wanted", "predicted by the solver", "measured"


class ControlChart:
    """The lay and its deviation, one above the other on one axis of turns.

    Args:
        tolerance: Half width of the band [m].
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance / MILLIMETRE
        self._chart = ui.echart(_options()).classes("control-chart")
        self._shown: tuple[float, float, int] = (math.nan, math.nan, 0)

    def update(self, state: ViewState) -> None:
        """Draw what is new."""
        shown = (state.control.time, state.lay_time, len(state.lay))
        if shown == self._shown:
            return
        self._shown = shown
        wound = state.control.wanted.end / FULL_TURN
        last = max(1, math.ceil(wound - 1.0e-6))
        first = max(0, last - TURNS)
        curves = {name: _within(points, first) for name, points in lay_curves(state).items()}
        options = self._chart.options
        for series in options["series"]:
            series["data"] = curves[series["id"]]
        for axis in options["xAxis"]:
            axis |= {"min": first, "max": last}
        z = _heights(curves, _WANTED, "measured", "predicted")
        off = _heights(curves, "measured off", "predicted off")
        band = _SEEN_TOLERANCES * self._tolerance
        # What is missing behind P0 is no reason for an axis below zero.
        bottom = min(z) if min(z) < -_NOISE * max(z) else 0.0
        upper, lower = options["yAxis"]
        for axis, ends in (
            (upper, ticks(bottom, max(z), _LEAST_Z)),
            (lower, ticks(min(*off, -band), max(*off, band), 0.0)),
        ):
            axis |= dict(zip(("min", "max", "interval"), ends, strict=True))
        options["series"][-1]["markArea"]["data"] = self._band(first, last)
        self._chart.update()

    def _band(self, first: int, last: int) -> list[list[dict[str, float]]]:
        begin = max(first, FIRST_JUDGED - 1)
        if begin >= last:
            return []
        limit = self._tolerance
        return [[{"xAxis": begin, "yAxis": -limit}, {"xAxis": last, "yAxis": limit}]]


def lay_curves(state: ViewState) -> dict[str, Points]:
    """Return [turns, mm] of every curve by its name."""
    control, wanted = state.control, state.control.wanted
    angle, radius = state.drum_angle, state.centreline_radius
    theta, z = np.zeros(0), np.zeros(0)
    if math.isfinite(angle) and math.isfinite(radius):
        theta, z = cable_lay(state.cable, angle, radius)
    places = state.lay
    return {
        _WANTED: _points(wanted.theta, wanted.z) if control.known else [],
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
    return [point for point in points if point[0] >= first]


def _heights(curves: dict[str, Points], *names: str) -> list[float]:
    return [y for name in names for _, y in curves[name]] or [0.0]


def _options() -> dict[str, Any]:
    label = {"color": SOFT, "fontSize": 11, "hideOverlap": True}
    axis = {
        "type": "value",
        "axisLabel": label,
        "splitLine": {"lineStyle": {"color": LINE}},
        "axisLine": {"lineStyle": {"color": SOFT}},
    }
    named = {"nameTextStyle": {"color": SOFT, "fontSize": 11, "align": "left"}, "nameGap": 8}
    # The axes stay at the bottom, not at zero.
    beneath = {"onZero": False, "lineStyle": {"color": SOFT}}
    across = {**axis, "minInterval": 1, "min": 0, "max": 1, "axisLine": beneath}
    line = {"type": "line", "showSymbol": False, "silent": True}
    dots = {"type": "scatter", "symbolSize": 4, "silent": True}
    return {
        "animation": False,
        "textStyle": {"fontFamily": FONT},
        "legend": {
            "top": 0,
            "right": 8,
            "itemWidth": 14,
            "itemHeight": 5,
            "itemGap": 12,
            "textStyle": {"fontSize": 11, "color": SOFT},
            "data": [
                {"name": _WANTED, "icon": "roundRect"},
                {"name": _PREDICTED_NAME, "icon": "roundRect"},
                {"name": _MEASURED_NAME, "icon": "circle"},
            ],
        },
        "grid": [
            {"left": 46, "right": 14, "top": 44, "height": "36%"},
            {"left": 46, "right": 14, "bottom": 38, "height": "32%"},
        ],
        "xAxis": [
            {**across, "gridIndex": 0, "axisLabel": {"show": False}},
            {
                **across,
                "gridIndex": 1,
                "name": "wound turns",
                "nameLocation": "middle",
                "nameGap": 22,
                "nameTextStyle": {"color": SOFT, "fontSize": 11},
            },
        ],
        "yAxis": [
            {**axis, **named, "gridIndex": 0, "name": "z, mm"},
            {**axis, **named, "gridIndex": 1, "name": "off the wanted lay, mm"},
        ],
        "series": [
            {
                **line,
                "id": _WANTED,
                "name": _WANTED,
                "lineStyle": {"color": SOFT, "width": 5, "opacity": 0.35},
                "itemStyle": {"color": SOFT},
                "data": [],
            },
            {
                **line,
                "id": "predicted",
                "name": _PREDICTED_NAME,
                "lineStyle": {"color": PREDICTED, "width": 1.5},
                "itemStyle": {"color": PREDICTED},
                "data": [],
            },
            {
                **dots,
                "id": "measured",
                "name": _MEASURED_NAME,
                "itemStyle": {"color": MEASURED},
                "data": [],
            },
            {
                **line,
                "id": "predicted off",
                "name": _PREDICTED_NAME,
                "xAxisIndex": 1,
                "yAxisIndex": 1,
                "lineStyle": {"color": PREDICTED, "width": 1.5},
                "itemStyle": {"color": PREDICTED},
                "data": [],
            },
            {
                **dots,
                "id": "measured off",
                "name": _MEASURED_NAME,
                "xAxisIndex": 1,
                "yAxisIndex": 1,
                "itemStyle": {"color": MEASURED},
                "data": [],
                "markArea": {
                    "silent": True,
                    "itemStyle": {"color": CORRECTED, "opacity": 0.14},
                    "data": [],
                },
            },
        ],
    }
