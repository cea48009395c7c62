"""Quality over runs as one HTML page: what drifts, control charts, the newest runs."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from winding_core.run_outcome import Verdict
from winding_core.units import MEGAPASCAL, MILLIMETRE
from winding_reports.documents.data_table import Column, DataTable
from winding_reports.documents.page import Tile, render_page
from winding_reports.documents.picture import (
    CORRECTED,
    FAINT,
    INK,
    PAPER,
    PREDICTED,
    TRACKED,
    Picture,
    canvas,
    picture,
)
from winding_reports.runs.run_row import RunRow
from winding_reports.runs.trend import AVERAGE_RUN_LENGTH, FIRST, LIMIT, Trend, announcements

MOST_PICTURES, MOST_RUNS, MOST_SENTENCES = 6, 30, 8
_TEMPLATE = "trend.html.j2"
_NOTES = (
    "Runs of one cable, on one machine, under one condition make a series. Runs that were broken "
    "off, lost data, are copies of others or have no date are listed and not charted.",
    "Each value is held against all before it since the last announcement; the grey band is three "
    "standard deviations of these, from successive differences.",
    "Below: self-starting cumulative sums (Hawkins 1987) of how unlikely each value is; above the "
    f"limit of {LIMIT:g} a drift is announced, and the chart begins anew. While nothing changes "
    f"there is one false announcement in {AVERAGE_RUN_LENGTH} runs of a chart.",
    f"The first {FIRST} runs of a series state its level and are not judged.",
)


def render_trend(
    folder: str, rows: Sequence[RunRow], counts: Mapping[str, int], found: Sequence[Trend]
) -> str:
    """Return the page of a folder as one HTML text that loads nothing from anywhere.

    Rows are in the order of their dates; of the trends the first are drawn.
    """
    sentences = announcements(found)
    drawn = [_picture(trend) for trend in found[:MOST_PICTURES]]
    return render_page(
        _TEMPLATE,
        title=folder,
        sentences=sentences[:MOST_SENTENCES],
        more=len(sentences) - MOST_SENTENCES,
        conditions={},
        contents=[*(item.title for item in drawn), "Newest runs", "What these numbers are worth"],
        tiles=_tiles(rows, counts, found),
        pictures=drawn,
        undrawn=len(found) - len(drawn),
        runs=runs_table(rows[-MOST_RUNS:][::-1]),
        notes=_NOTES,
        facts={},
        facts_title="",
    )


def _tiles(rows: Sequence[RunRow], counts: Mapping[str, int], found: Sequence[Trend]) -> list[Tile]:
    total, good = sum(counts.values()), counts.get(Verdict.GOOD, 0)
    others = ", ".join(f"{count} {name}" for name, count in counts.items() if name != Verdict.GOOD)
    last = rows[-1].date if rows else None
    drifting = sum(bool(trend.chart.drifts) for trend in found)
    return [
        Tile(label="Runs", value=f"{total:,}", remark="" if last is None else f"to {last[:10]}"),
        Tile(label="Good", value=f"{good:,}", remark=f"{100.0 * good / max(total, 1):.0f} %"),
        Tile(label="Others", value=f"{total - good:,}", remark=others),
        Tile(label="Charts", value=str(len(found)), remark="a quantity of a series each"),
        Tile(label="With a drift", value=str(drifting)),
    ]


def runs_table(rows: Sequence[RunRow]) -> DataTable:
    """Return runs as a table, with the reason of each that is not good."""
    return DataTable(
        name="runs",
        title="Runs",
        columns=(
            *map(_column, ("date", "run", "verdict", "cable", "machine", "batch", "operator")),
            *(_column("E, MPa", 4), _column("error, %"), _column("lay, mm")),
            _column("reason or remark"),
        ),
        rows=tuple(
            (
                *(row.date or "", row.path, row.verdict, row.cable, row.machine),
                *(row.batch, row.operator),
                None if row.young_pa is None else row.young_pa / MEGAPASCAL,
                row.error_pct,
                None if row.lay_error_m is None else row.lay_error_m / MILLIMETRE,
                "; ".join(filter(None, (row.reason, row.remark))),
            )
            for row in rows
        ),
    )


def _column(name: str, digits: int = 2) -> Column:
    return Column(name=name, digits=digits)


def _picture(trend: Trend) -> Picture:
    chart, quantity = trend.chart, trend.quantity
    number = np.arange(1, len(trend.rows) + 1)
    heading = f"{quantity.title[0].upper()}{quantity.title[1:]}: {trend.name}"
    with canvas(3.6, rows=2, heights=(2.0, 1.0)) as (figure, (above, below)):
        above.fill_between(number, chart.low, chart.high, color=FAINT, alpha=0.25, linewidth=0)
        above.plot(number, chart.centre, color=FAINT, label="level before")
        style = "o" if len(number) <= 200 else "."
        above.plot(number, chart.values, style, color=TRACKED, markersize=3.5, label="run")
        if trend.limit is not None:
            above.axhline(trend.limit, color=PAPER, linestyle="--", label="limit")
        for drift in chart.drifts:
            for axes in (above, below):
                axes.axvline(drift.at + 1, color=INK, linewidth=0.8)
            span = (drift.since + 1, drift.at + 1)
            above.plot(span, (drift.now, drift.now), color=INK, linewidth=2.0)
        above.set_ylabel(quantity.unit or "share")
        _ranged(above, trend)
        above.legend(loc="upper left", ncols=3, fontsize=8)
        below.plot(number, chart.upward, color=PREDICTED, label="up")
        below.plot(number, chart.downward, color=CORRECTED, linestyle="--", label="down")
        below.axhline(LIMIT, color=PAPER, linestyle="--")
        below.set_ylim(
            0.0, max(1.25 * LIMIT, 1.05 * float(np.nanmax([chart.upward, chart.downward])))
        )
        below.set_ylabel("cumulative sum")
        below.set_xlabel("run of the series")
        below.legend(loc="upper left", ncols=2, fontsize=8)
        for axes in (above, below):
            axes.set_xlim(0.5, len(number) + 0.5)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        newest = chart.drifts[-1] if chart.drifts else None
        sentence = "No drift." if newest is None else f"{trend.sentence(newest)}."
        return picture(figure, heading, sentence[0].upper() + sentence[1:])


def _ranged(axes: Axes, trend: Trend) -> None:
    """Keep the axis to the values: the band of the first judged runs may be as wide as it likes."""
    shown = [*trend.chart.values.tolist(), *([] if trend.limit is None else [trend.limit])]
    low, high = min(shown), max(shown)
    room = 0.6 * (high - low) or 0.01 * abs(high) or 1.0
    axes.set_ylim(low - 0.4 * room, high + room)
