"""What drifts over runs: every quantity of every series of runs on a chart of its own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from winding_core.units import MEGAPASCAL, MILLIMETRE
from winding_reports.documents.data_table import Column, DataTable, Value
from winding_reports.runs.drift_chart import (
    ALLOWANCE,
    AVERAGE_RUN_LENGTH,
    FIRST,
    LIMIT,
    Drift,
    DriftChart,
    drift_chart,
)
from winding_reports.runs.run_row import RunRow

# A forecast beyond so many runs is meaningless.
_FARTHEST = 200


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
            "cable": first.cable,
            "machine": first.machine,
            "series": first.series,
            "quantity": self.quantity.name,
            "title": self.quantity.title,
            "unit": self.quantity.unit,
            "runs": len(self.rows),
            "first_date": first.date,
            "last_date": last.date,
            "mean": float(values.mean()),
            "newest": float(values[-1]),
            "limit": self.limit,
            "drifts": [
                {
                    "run": drift.at + 1,
                    "run_id": self.rows[drift.at].run_id,
                    "path": self.rows[drift.at].path,
                    "date": self.rows[drift.at].date,
                    "since_run": drift.since + 1,
                    "direction": "up" if drift.up else "down",
                    "level": drift.level,
                    "now": drift.now,
                    "runs_to_limit": self._runs_left(drift),
                    "sentence": self.sentence(drift),
                }
                for drift in self.chart.drifts
            ],
        }


def trends(rows: Iterable[RunRow]) -> list[Trend]:
    """Return a trend for every quantity of every series that can be charted.

    That with the newest announcement is the first.

    Runs that were broken off, lost data or have no date are left out.

    Args:
        rows: In the order of their dates.
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
