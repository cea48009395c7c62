"""The charts of the last minute: speeds against setpoints, tension, a marker's curve length."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from winding_core.units import MILLIMETRE
from winding_dashboard.drawings.line_chart import Curve, Ends, chart, ends_of
from winding_dashboard.state.view_state import Trace, ViewState

# Shown before anything has come, so that axes do not jump [s].
_LEAST_SPAN = 10.0
_TICKS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_MOST_TICKS = 6
_MILLI = 1.0 / MILLIMETRE


class Series(NamedTuple):
    """One curve of a chart."""

    column: str  # Of the trace that it draws
    name: str  # In the legend; empty for a bound of another curve
    style: str  # CSS classes

    def curve(self, trace: Trace, scale: float, origin: float) -> Curve:
        """Return [t - origin, scale x value] of every sample."""
        values = [(t - origin, scale * sample[self.column]) for t, sample in trace]
        points = [[round(t, 3), None if math.isnan(y) else round(y, 5)] for t, y in values]
        return Curve(points=points, style=self.style)


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
        curves = [item.curve(trace, self.scale, origin) for item in self.series]
        low, high = 0.0, _LEAST_SPAN
        if trace and math.isfinite(origin):
            last = trace[-1][0] - origin
            low = min(trace[0][0] - origin, max(0.0, last - _LEAST_SPAN))
            high = max(last, low + _LEAST_SPAN)
        step = next((step for step in _TICKS if (high - low) / step <= _MOST_TICKS), _TICKS[-1])
        # Ticks stand at whole multiples, whenever the first sample came.
        low = step * math.floor(low / step)
        return chart(curves, Ends(low, high, step), ends_of(curves, self.least), unit=" s")


_SPEED = (
    Series("speed", "measured", "is-measured"),
    Series("speed_set", "setpoint", "is-set dashed"),
)
_FEED = (Series("feed", "measured", "is-measured"), Series("feed_set", "setpoint", "is-set dashed"))
_TENSION = (Series("tension", "measured", "is-measured"),)
_LENGTH = (
    Series("measured", "measured", "is-measured"),
    Series("predicted", "predicted", "is-predicted dashed"),
    Series("corrected", "corrected ±", "is-corrected"),
    Series("low", "", "is-corrected thin dashed"),
    Series("high", "", "is-corrected thin dashed"),
)
SPEEDS = (
    LiveChart(id="chart-speed", title="Cylinder speed, rad/s", series=_SPEED, least=0.2),
    LiveChart(id="chart-feed", title="Carriage speed, mm/s", series=_FEED, scale=_MILLI),
    LiveChart(id="chart-tension", title="Tension at the guide, N", series=_TENSION, least=0.2),
)
LENGTH = LiveChart(id="chart-length", title="Curve length, mm", series=_LENGTH, scale=_MILLI)
CHARTS = (*SPEEDS, LENGTH)


def speed_drawings(state: ViewState) -> dict[str, str]:
    """Return the drawings of the machine's charts by their elements."""
    return {item.id: item.drawing(state.speeds, state.run_began) for item in SPEEDS}


def length_drawing(state: ViewState, marker: int) -> str:
    """Return the drawing of a marker's curve length; 0 is the newest marker."""
    return LENGTH.drawing(state.lengths[marker or state.newest_marker()], state.run_began)
