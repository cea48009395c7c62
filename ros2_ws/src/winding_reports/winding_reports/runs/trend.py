"""What drifts over runs: every quantity of every series of runs on a chart of its own.

A chart needs no known level: self-starting CUSUM (Hawkins 1987, Journal of Quality Technology 19;
Hawkins and Olwell 1998, chapter 7). Each value is held against all before it since the last
announcement,

    t = (x - mean) / (s sqrt(1 + 1 / m)),    u = Phi^-1(F_nu(t)),
    C+ = max(0, C+ + u - k),    C- = max(0, C- - u - k),    announced above h.

u is standard normal while nothing changes, whatever level and scatter are, so that the average
run length is that of a CUSUM whose level is known. s is taken from successive differences (von
Neumann et al. 1941), s^2 = sum (x_i - x_{i-1})^2 / (2 (m - 1)), with nu = 2 (m - 1)^2 / (3 m - 4)
degrees of freedom: a drift that goes on from the first run does not hide in its own scatter.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri, stdtr

from winding_core.units import MEGAPASCAL, MILLIMETRE, json_values
from winding_reports.documents.data_table import Column, DataTable, Value
from winding_reports.runs.run_row import RunRow

# Half a standard deviation is what is to be found at least; with this limit there is a false
# announcement in 760 stable runs, in both directions together (`tests/winding_reports`).
ALLOWANCE, LIMIT = 0.5, 5.5
AVERAGE_RUN_LENGTH = 760
FIRST = 4  # So many values state a level before the next one is judged
# Beyond these a normal deviate is saturated.
_LARGEST = 8.0
_SIGMAS = 3.0
_SLOPE_VALUES = 10
_ROUND_OFF = 1.0e-6  # Less than this share of the level is round-off and no scatter


@dataclass(frozen=True, kw_only=True)
class Drift:
    """An announced change of level."""

    begin: int  # First value of the chart that announces it
    since: int  # First value that belongs to the change
    at: int  # Value with which it is announced
    up: bool  # Whether values grow
    level: float  # Mean before the change
    now: float  # Mean since the change
    pace: float  # Change per value, by least squares over it, ten values at least


@dataclass(frozen=True, kw_only=True)
class DriftChart:
    """A chart of values in their order, shape (n,); nan where a value is not judged yet."""

    values: NDArray[np.float64]
    centre: NDArray[np.float64]  # Mean of what a value is held against
    low: NDArray[np.float64]  # Three standard deviations below
    high: NDArray[np.float64]  # Three standard deviations above
    upward: NDArray[np.float64]  # C+
    downward: NDArray[np.float64]  # C-
    drifts: tuple[Drift, ...]  # In the order of their announcements


def drift_chart(values: ArrayLike, *, falls: bool = True) -> DriftChart:
    """Return the chart of values in their order, shape (n,).

    Args:
        values: Finite.
        falls: Whether a fall is announced, too, and not a rise alone.

    Raises:
        ValueError: A value is not finite.
    """
    x = np.asarray(values, dtype=float)
    if x.ndim != 1 or not np.isfinite(x).all():
        raise ValueError(f"a chart needs finite values in a row, got shape {x.shape}")
    rows = np.full((5, len(x)), np.nan)
    drifts: list[Drift] = []
    begin = 0
    while begin < len(x):
        begin = _piece(x.tolist(), begin, rows, drifts, falls)
    return DriftChart(
        values=x,
        centre=rows[0],
        low=rows[1],
        high=rows[2],
        upward=rows[3],
        downward=rows[4],
        drifts=tuple(drifts),
    )


def _piece(
    x: list[float], begin: int, rows: NDArray[np.float64], drifts: list[Drift], falls: bool
) -> int:
    """Chart values up to an announcement; return the first of the next piece."""
    # Of the values before the present one, less the first: that loses no digits.
    total, squares, count = 0.0, 0.0, 1
    up = down = 0.0
    since = {True: begin + FIRST, False: begin + FIRST}
    for i in range(begin + 1, len(x)):
        mean = x[begin] + total / count
        if count >= FIRST:
            scatter = max(math.sqrt(squares / (2.0 * (count - 1))), _ROUND_OFF * abs(mean))
            sigma = scatter * math.sqrt(1.0 + 1.0 / count)
            u = _deviate(x[i] - mean, sigma, count)
            up, down = max(0.0, up + u - ALLOWANCE), falls * max(0.0, down - u - ALLOWANCE)
            rows[:, i] = (mean, mean - _SIGMAS * sigma, mean + _SIGMAS * sigma, up, down)
            if max(up, down) > LIMIT:
                upward = up > down
                drifts.append(_drift(x, begin, since[upward], i, upward))
                return i + 1
            if up == 0.0:
                since[True] = i + 1
            if down == 0.0:
                since[False] = i + 1
        total += x[i] - x[begin]
        squares += (x[i] - x[i - 1]) ** 2
        count += 1
    return len(x)


def _deviate(off: float, sigma: float, count: int) -> float:
    """Return the normal deviate that is as unlikely as a value so far off."""
    if off == 0.0:
        return 0.0
    if sigma == 0.0:
        return math.copysign(_LARGEST, off)
    freedom = 2.0 * (count - 1) ** 2 / (3 * count - 4)
    # The lower tail keeps its digits.
    deviate = float(ndtri(stdtr(freedom, -abs(off) / sigma)))
    return math.copysign(min(-deviate, _LARGEST), off)


def _drift(x: Sequence[float], begin: int, since: int, at: int, up: bool) -> Drift:
    # Fewer values have a slope of scatter alone.
    first = max(begin, min(since, at + 1 - _SLOPE_VALUES))
    pace = float(np.polyfit(np.arange(at + 1 - first), x[first : at + 1], 1)[0])
    return Drift(
        begin=begin,
        since=since,
        at=at,
        up=up,
        level=fmean(x[begin:since]),
        now=fmean(x[since : at + 1]),
        pace=pace,
    )


_FARTHEST = 200  # A forecast beyond so many runs is meaningless


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A number of a run that is charted."""

    name: str  # Field of `RunRow`
    title: str  # What it is
    unit: str  # As it is shown
    scale: float = 1.0  # One shown unit in that of the field
    limit: str = ""  # Field of the limit that it must not exceed; empty for none


QUANTITIES = (
    Quantity(name="young_pa", title="identified modulus", unit="MPa", scale=MEGAPASCAL),
    Quantity(name="length_error_pct", title="measured over predicted length", unit="%"),
    Quantity(
        name="error_pct", title="largest error of a length", unit="%", limit="error_limit_pct"
    ),
    Quantity(
        name="lay_error_m",
        title="largest error of the lay",
        unit="mm",
        scale=MILLIMETRE,
        limit="lay_tolerance_m",
    ),
    Quantity(name="free_length_m", title="free length", unit="mm", scale=MILLIMETRE),
    Quantity(name="load_share", title="load share", unit=""),
)


@dataclass(frozen=True, kw_only=True)
class Trend:
    """One quantity over the runs of one series, in shown units."""

    quantity: Quantity
    rows: tuple[RunRow, ...]  # In the order of their dates
    chart: DriftChart  # Of its values

    @property
    def name(self) -> str:
        """Cable and machine."""
        first = self.rows[0]
        return f"{first.cable or 'a cable'} on {first.machine or 'a machine'}"

    @property
    def limit(self) -> float | None:
        """What the newest run must not exceed, in the shown unit."""
        if not self.quantity.limit:
            return None
        limit = getattr(self.rows[-1], self.quantity.limit)
        return None if limit is None else limit / self.quantity.scale

    @property
    def announced(self) -> str:
        """Date of the newest announcement; empty for none."""
        drifts = self.chart.drifts
        return (self.rows[drifts[-1].at].date or "") if drifts else ""

    def sentence(self, drift: Drift) -> str:
        """Return an announcement in words."""
        quantity, at = self.quantity, self.rows[drift.at]
        unit = f" {quantity.unit}" if quantity.unit else ""
        change = drift.now - drift.level
        share = f", {100.0 * change / drift.level:+.2g} %" if drift.level and unit != " %" else ""
        words = (
            f"{quantity.title} of {self.name} drifts {'up' if drift.up else 'down'}: announced "
            f"with run {drift.at + 1} of {len(self.rows)} ({at.run_id or at.path}, {at.date}), "
            f"since about run {drift.since + 1} {drift.now:.4g}{unit} after "
            f"{drift.level:.4g}{unit}{share}"
        )
        left = self._runs_left(drift)
        if left is None:
            return words
        limit = f"its limit of {self.limit:.4g}{unit}"
        if left == 0:
            return f"{words}; it is over {limit}"
        return f"{words}; at this pace {limit} is reached in about {left} runs"

    def _runs_left(self, drift: Drift) -> int | None:
        """Return in how many runs the limit is exceeded at this pace; None for not soon."""
        limit = self.limit
        if limit is None or drift.pace <= 0.0:
            return None
        middle = 0.5 * (drift.at - drift.since)
        runs = (limit - drift.now) / drift.pace - middle
        return max(0, math.ceil(runs)) if runs <= _FARTHEST else None

    def as_json(self) -> dict[str, Any]:
        """Return the figures of a trend as JSON values."""
        first, last = self.rows[0], self.rows[-1]
        values = self.chart.values
        return {
            **json_values(first, "cable", "machine", "series"),
            **json_values(self.quantity, "title", "unit"),
            "quantity": self.quantity.name,
            "runs": len(self.rows),
            "first_date": first.date,
            "last_date": last.date,
            "mean": float(values.mean()),
            "newest": float(values[-1]),
            "limit": self.limit,
            "drifts": [
                {
                    "run": drift.at + 1,
                    **json_values(self.rows[drift.at], "run_id", "path", "date"),
                    "since_run": drift.since + 1,
                    "direction": "up" if drift.up else "down",
                    **json_values(drift, "level", "now"),
                    "runs_to_limit": self._runs_left(drift),
                    "sentence": self.sentence(drift),
                }
                for drift in self.chart.drifts
            ],
        }


def trends(rows: Iterable[RunRow]) -> list[Trend]:
    """Return a trend for every quantity of every series that can be charted.

    That with the newest announcement is the first.

    Rows are in the order of their dates; those that were broken off, lost data or have no date are
    left out.
    """
    series: dict[tuple[str | None, str | None, str], list[RunRow]] = {}
    for row in rows:
        if row.healthy and row.date:
            series.setdefault((row.machine, row.cable, row.series), []).append(row)
    found = [
        trend
        for runs in series.values()
        for quantity in QUANTITIES
        if (trend := _trend(quantity, runs)) is not None
    ]
    return sorted(found, key=lambda trend: trend.announced, reverse=True)


def _trend(quantity: Quantity, runs: Sequence[RunRow]) -> Trend | None:
    measured = tuple(row for row in runs if getattr(row, quantity.name) is not None)
    if len(measured) <= FIRST:
        return None
    values = [getattr(row, quantity.name) / quantity.scale for row in measured]
    return Trend(
        quantity=quantity, rows=measured, chart=drift_chart(values, falls=not quantity.limit)
    )


def announcements(found: Iterable[Trend]) -> list[str]:
    """Return every announced drift in words, the newest first."""
    dated = [
        (trend.rows[drift.at].date or "", trend.sentence(drift))
        for trend in found
        for drift in trend.chart.drifts
    ]
    return [sentence for _, sentence in sorted(dated, key=lambda item: item[0], reverse=True)]


def trend_json(found: Sequence[Trend], runs: int) -> dict[str, Any]:
    """Return trends as JSON values; `runs` is how many were looked at."""
    return {
        "runs": runs,
        "chart": {
            "kind": "self-starting CUSUM",
            "allowance": ALLOWANCE,
            "limit": LIMIT,
            "average_run_length": AVERAGE_RUN_LENGTH,
            "first_judged_run": FIRST + 1,
        },
        "announcements": announcements(found),
        "trends": [trend.as_json() for trend in found],
    }


_POINTS = (
    *("machine", "cable", "series", "quantity", "unit", "run", "run_id", "path", "date", "verdict"),
    *("batch", "operator", "remark", "value", "centre", "low", "high", "upward", "downward"),
    "announced",
)


def points_table(found: Iterable[Trend]) -> DataTable:
    """Return every point of every chart in a row, in shown units."""
    return DataTable(
        name="trend",
        title="Charts over runs",
        columns=tuple(Column(name=name, digits=4) for name in _POINTS),
        rows=tuple(row for trend in found for row in _points(trend)),
    )


def _points(trend: Trend) -> Iterator[tuple[Value, ...]]:
    chart, quantity = trend.chart, trend.quantity
    numbers = (
        chart.values, chart.centre, chart.low, chart.high, chart.upward, chart.downward
    )  # fmt: skip
    announced = {drift.at for drift in chart.drifts}
    columns = zip(trend.rows, *(item.tolist() for item in numbers), strict=True)
    for number, (row, *values) in enumerate(columns):
        yield (
            *(row.machine, row.cable, row.series, quantity.name, quantity.unit, number + 1),
            *(row.run_id, row.path, row.date, row.verdict, row.batch, row.operator, row.remark),
            *values,
            int(number in announced),
        )
