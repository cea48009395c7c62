"""The charts of the last minute: speeds against setpoints, tension, a marker's curve length."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.units import MILLIMETRE
from winding_dashboard.drawings.line_chart import Curve, Ends, chart, ends_of
from winding_dashboard.state.trace import Trace
from winding_dashboard.state.view_state import ViewState

# Shown before anything has come, so that axes do not jump [s].
_LEAST_SPAN = 10.0
_TICKS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_MOST_TICKS = 6


@dataclass(frozen=True, kw_only=True)
class Series:
    """One curve of a chart."""

    column: str  # Of the trace that it draws
    name: str  # In the legend; empty for a bound of another curve
    style: str  # CSS classes


@dataclass(frozen=True, kw_only=True)
class LiveChart:
    """Curves of one trace over the time of the run."""

    id: str  # Of its element
    title: str  # With the unit
    series: tuple[Series, ...]  # The curves
    scale: float = 1.0  # Factor from SI to the unit of the title
    least: float = 1.0  # Smallest height of the vertical axis, in that unit: noise stays small

    def drawing(self, trace: Trace, origin: float) -> str:
        """Return the inside of its SVG element; time counts from an origin [s]."""
        curves = [
            Curve(points=trace.points(item.column, self.scale, origin), style=item.style)
            for item in self.series
        ]
        first, last = trace.first_time - origin, trace.last_time - origin
        low, high = 0.0, _LEAST_SPAN
        if math.isfinite(last):
            low = min(first, max(0.0, last - _LEAST_SPAN))
            high = max(last, low + _LEAST_SPAN)
        step = next((step for step in _TICKS if (high - low) / step <= _MOST_TICKS), _TICKS[-1])
        # Ticks stand at whole multiples, whenever the first sample came.
        low = step * math.floor(low / step)
        return chart(curves, Ends(low, high, step), ends_of(curves, self.least), unit=" s")


_SET = Series(column="speed_set", name="setpoint", style="is-set dashed")
SPEEDS = (
    LiveChart(
        id="chart-speed",
        title="Cylinder speed, rad/s",
        series=(Series(column="speed", name="measured", style="is-measured"), _SET),
        least=0.2,
    ),
    LiveChart(
        id="chart-feed",
        title="Carriage speed, mm/s",
        series=(
            Series(column="feed", name="measured", style="is-measured"),
            Series(column="feed_set", name="setpoint", style="is-set dashed"),
        ),
        scale=1.0 / MILLIMETRE,
        least=1.0,
    ),
    LiveChart(
        id="chart-tension",
        title="Tension at the guide, N",
        series=(Series(column="tension", name="measured", style="is-measured"),),
        least=0.2,
    ),
)
LENGTH = LiveChart(
    id="chart-length",
    title="Curve length, mm",
    series=(
        Series(column="measured", name="measured", style="is-measured"),
        Series(column="predicted", name="predicted", style="is-predicted dashed"),
        Series(column="corrected", name="corrected ±", style="is-corrected"),
        Series(column="low", name="", style="is-corrected thin dashed"),
        Series(column="high", name="", style="is-corrected thin dashed"),
    ),
    scale=1.0 / MILLIMETRE,
    least=1.0,
)
CHARTS = (*SPEEDS, LENGTH)


def speed_drawings(state: ViewState) -> dict[str, str]:
    """Return the drawings of the machine's charts by their elements."""
    return {item.id: item.drawing(state.speeds, state.run_began) for item in SPEEDS}


def length_drawing(state: ViewState, marker: int) -> str:
    """Return the drawing of a marker's curve length; 0 is the newest marker."""
    return LENGTH.drawing(state.lengths[marker or state.newest_marker()], state.run_began)
