"""The live charts: speeds against setpoints, tension, curve lengths."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from nicegui import ui

from winding_core.units import MILLIMETRE
from winding_dashboard.views.axis_ticks import ticks
from winding_dashboard.views.elements import heading
from winding_dashboard.views.lay_view import LayChart
from winding_dashboard.views.palette import (
    CORRECTED,
    FONT,
    LINE,
    MEASURED,
    PREDICTED,
    SETPOINT,
    SOFT,
)
from winding_dashboard.views.trace import Trace
from winding_dashboard.views.view_state import ViewState

# Shown before anything has come, so that axes do not jump [s].
_LEAST_SPAN = 10.0


@dataclass(frozen=True, kw_only=True)
class Series:
    """One curve of a chart.

    Attributes:
        column: Of the trace that it draws.
        name: In the legend.
        colour: CSS colour.
        dashed: Drawn with gaps.
        width: [pixels].
    """

    column: str
    name: str
    colour: str
    dashed: bool = False
    width: float = 2.0


class LiveChart:
    """Curves of one trace over the machine's time.

    Args:
        title: With the unit.
        series: The curves.
        scale: Factor from SI to the unit of the title.
        least: Smallest height of the vertical axis, in that unit: noise stays small.
    """

    def __init__(
        self, title: str, series: Sequence[Series], *, scale: float = 1.0, least: float = 0.0
    ) -> None:
        self._series, self._scale, self._least = tuple(series), scale, least
        with ui.element("section").classes("card").props(f'aria-label="Chart: {title}"'):
            with ui.element("div").classes("heading-row"):
                self.title = heading(title)
                self.corner = ui.element("div")
            self._chart = ui.echart(_options(self._series)).classes("chart")
        self._shown: tuple[int, float, str] = (0, 0.0, "")

    def update(self, trace: Trace, label: str = "") -> None:
        """Draw a trace if it is another one, or has grown, since the last call."""
        shown = (len(trace), trace.last_time, label)
        if shown == self._shown:
            return
        self._shown = shown
        options = self._chart.options
        values: list[float] = []
        for drawn, series in zip(options["series"], self._series, strict=True):
            drawn["data"] = trace.points(series.column, self._scale)
            values += [y for _, y in drawn["data"] if y is not None]
        if trace.points(self._series[0].column):
            first = trace.points(self._series[0].column)[0][0]
            assert first is not None
            last = trace.last_time
            options["xAxis"]["min"] = math.floor(min(first, max(0.0, last - _LEAST_SPAN)))
            options["xAxis"]["max"] = round(max(last, options["xAxis"]["min"] + _LEAST_SPAN), 1)
        if values:
            low, high, step = ticks(min(values), max(values), self._least)
            options["yAxis"] |= {"min": low, "max": high, "interval": step}
        self._chart.update()


def _options(series: Sequence[Series]) -> dict[str, Any]:
    axis = {
        "type": "value",
        "axisLabel": {"color": SOFT, "fontSize": 11, "hideOverlap": True, "showMaxLabel": False},
        "splitLine": {"lineStyle": {"color": LINE}},
        "axisLine": {"lineStyle": {"color": SOFT}},
    }
    return {
        "animation": False,
        "textStyle": {"fontFamily": FONT},
        "grid": {"left": 46, "right": 14, "top": 26, "bottom": 24},
        "legend": {
            "top": 0,
            "left": 0,
            "icon": "roundRect",
            "itemWidth": 14,
            "itemHeight": 4,
            "itemGap": 10,
            "textStyle": {"fontSize": 11, "color": SOFT},
            "data": [item.name for item in series if item.name],
        },
        "tooltip": {"trigger": "axis", "confine": True, "transitionDuration": 0},
        "xAxis": {
            **axis,
            "min": 0,
            "max": _LEAST_SPAN,
            "splitLine": {"show": False},
            "axisLabel": {**axis["axisLabel"], "formatter": "{value} s"},  # type: ignore[dict-item]
        },
        "yAxis": {
            **axis,
            "scale": True,
            "axisLabel": {**axis["axisLabel"], "showMaxLabel": True},  # type: ignore[dict-item]
        },
        "series": [
            {
                "type": "line",
                "name": item.name,
                "data": [],
                "showSymbol": False,
                "silent": True,
                "lineStyle": {
                    "color": item.colour,
                    "width": item.width,
                    "type": "dashed" if item.dashed else "solid",
                },
                "itemStyle": {"color": item.colour},
            }
            for item in series
        ],
    }


class Charts:
    """The row of charts.

    Args:
        choose: Called with the number of the marker that is chosen; 0 for the newest.
    """

    def __init__(self, choose: Callable[[int], None]) -> None:
        self._speed = LiveChart(
            "Cylinder speed, rad/s",
            (
                Series(column="speed", name="measured", colour=MEASURED),
                Series(column="speed_set", name="setpoint", colour=SETPOINT, dashed=True),
            ),
            least=0.2,
        )
        self._feed = LiveChart(
            "Carriage speed, mm/s",
            (
                Series(column="feed", name="measured", colour=MEASURED),
                Series(column="feed_set", name="setpoint", colour=SETPOINT, dashed=True),
            ),
            scale=1.0 / MILLIMETRE,
            least=1.0,
        )
        self._tension = LiveChart(
            "Tension at the guide, N",
            (Series(column="tension", name="measured", colour=MEASURED),),
            least=0.2,
        )
        self._length = LiveChart(
            "S1, mm",
            (
                Series(column="measured", name="measured", colour=MEASURED),
                Series(column="predicted", name="predicted", colour=PREDICTED, dashed=True),
                Series(column="corrected", name="corrected ±", colour=CORRECTED),
                Series(column="low", name="", colour=CORRECTED, dashed=True, width=1.0),
                Series(column="high", name="", colour=CORRECTED, dashed=True, width=1.0),
            ),
            scale=1.0 / MILLIMETRE,
            least=1.0,
        )
        with self._length.corner:
            ui.toggle(
                {0: "last", 1: "P1", 2: "P2", 3: "P3", 4: "P4"},
                value=0,
                on_change=lambda event: choose(int(event.value)),
            ).props('dense no-caps unelevated padding="0 5px" toggle-color=grey-9').classes(
                "markers-choice"
            ).props('aria-label="Marker of the curve length chart"')
        self._lay = LayChart()

    def update(self, state: ViewState, marker: int) -> None:
        """Draw what is new; marker 0 is the newest one."""
        for chart in (self._speed, self._feed, self._tension):
            chart.update(state.speeds)
        number = marker or state.newest_marker()
        self._length.title.set_text(f"S{number}, mm")
        self._length.update(state.lengths[number], f"P{number}")
        # Where a lay is wanted, its controller's picture tells more than the commanded helix.
        if state.control.known:
            self._lay.hide()
        else:
            self._lay.update(state.lay_time, state.lay, state.advance)
