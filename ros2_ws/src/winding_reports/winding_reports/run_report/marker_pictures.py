"""Pictures of the markers of one run: over time, on the unrolled cylinder, their lengths."""

import math

import numpy as np
from matplotlib.axes import Axes

from winding_core.cable.cases import PublishedMarker
from winding_core.error_verdict import error_pct
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw
from winding_core.units import MILLIMETRE
from winding_reports.documents.picture import (
    CORRECTED,
    FAINT,
    PAPER,
    PAPER_CORRECTED,
    PREDICTED,
    PUBLISHED,
    ROD,
    TRACKED,
    Picture,
    broken,
    canvas,
    picture,
    write_beside,
)
from winding_reports.records.run_record import MarkerRow, MarkerSeries, RunRecord

_TURN = 2.0 * math.pi
_ROD_AHEAD = "rod, ahead of the run"


def marker_picture(record: RunRecord) -> Picture:
    """Return theta and z of predicted and tracked markers over time, and their difference."""
    with canvas(5.6, rows=2, columns=2) as (figure, (theta, z, dtheta, dz)):
        for marker in record.marker_ids:
            predicted, tracked = record.predicted.of(marker), record.tracked.of(marker)
            for axes, name, scale in ((theta, "theta", 1.0 / _TURN), (z, "z", 1e3)):
                for series, colour, width in ((tracked, TRACKED, 3.0), (predicted, PREDICTED, 1.2)):
                    axes.plot(
                        *broken(series.t, scale * getattr(series, name)),
                        color=colour,
                        linewidth=width,
                        solid_capstyle="butt",
                    )
                last = predicted if len(predicted.t) else tracked
                if len(last.t):
                    place = last.t[-1], getattr(last, name)[-1] * scale
                    write_beside(axes, f"P{marker}", place, dx=4, va="center")
            for axes, name, scale in ((dtheta, "theta", 1e3), (dz, "z", 1e3)):
                _difference(axes, predicted, tracked, name, scale)
        for axes, title in (
            (theta, "wound angle, turns"),
            (z, "axial position, mm"),
            (dtheta, "predicted - tracked angle, mrad"),
            (dz, "predicted - tracked position, mm"),
        ):
            axes.set_title(title)
            axes.set_xlim(0.0, record.end)
        for axes in (dtheta, dz):
            axes.set_xlabel("time, s")
            axes.axhline(0.0, color=FAINT, linewidth=0.8)
        theta.plot([], [], color=TRACKED, linewidth=3.0, label="tracked")
        theta.plot([], [], color=PREDICTED, linewidth=1.2, label="predicted")
        theta.legend(loc="upper left")
    return picture(
        figure,
        "Markers over time",
        "A line begins where its marker comes to lie on the cylinder and breaks while the camera "
        "does not see it; a level line is a marker that stays where it was laid.",
    )


def lay_picture(record: RunRecord) -> Picture:
    """Return the lay on the unrolled cylinder."""
    with canvas(3.4) as (figure, (axes,)):
        measured = [row.experiment for row in record.published if row.experiment]
        places = {
            name: [_last(record, name, marker) for marker in record.marker_ids]
            for name in ("tracked", "predicted", "rod")
        }
        reached = [theta for found in places.values() for theta, _ in found]
        reach = max([0.0, *reached, *(lay.theta for lay in measured)])
        if reach > 0.0 and record.drive.feed_speed > 0.0:
            law = FleetAngleLaw(
                advance_per_radian=record.drive.advance_per_radian,
                free_length=PAPER_FREE_LENGTH,
                radius=record.case.centreline_radius,
            )
            theta = np.linspace(0.0, 1.05 * reach, 200)
            axes.plot(
                theta / _TURN,
                law.z(theta) / MILLIMETRE,
                color=FAINT,
                label="kinematic reference",
                zorder=1,
            )
        sizes = {TRACKED: 90, PREDICTED: 36, ROD: 12}
        for (name, found), (colour, size) in zip(places.items(), sizes.items(), strict=True):
            known = np.array([place for place in found if place[0] > 0.0])
            if known.size:
                turns, heights = (known / (_TURN, MILLIMETRE)).T
                label = _ROD_AHEAD if name == "rod" else name
                axes.scatter(turns, heights, s=size, color=colour, label=label, zorder=2)
        if measured:
            axes.scatter(
                [lay.theta / _TURN for lay in measured],
                [lay.z / MILLIMETRE for lay in measured],
                marker="D",
                s=60,
                facecolors="none",
                edgecolors=PUBLISHED,
                label="published experiment",
                zorder=3,
            )
        axes.set_xlabel("wound angle, turns")
        axes.set_title("axial position, mm")
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper left")
    return picture(
        figure,
        "The lay on the unrolled cylinder",
        "Where each marker lies at the end of the run. The line is the no-slip, quasi-static "
        "reference for one guide distance.",
    )


def _last(record: RunRecord, name: str, marker: int) -> tuple[float, float]:
    series: MarkerSeries = getattr(record, name).of(marker)
    return (float(series.theta[-1]), float(series.z[-1])) if len(series.t) else (0.0, 0.0)


def _difference(
    axes: Axes, predicted: MarkerSeries, tracked: MarkerSeries, name: str, scale: float
) -> None:
    if not len(predicted.t) or not len(tracked.t):
        return
    both = (tracked.t >= predicted.t[0]) & (tracked.t <= predicted.t[-1])
    t = tracked.t[both]
    if not len(t):
        return
    model = np.interp(t, predicted.t, getattr(predicted, name))
    gap = scale * (model - getattr(tracked, name)[both])
    axes.plot(*broken(t, gap), color=PREDICTED, linewidth=0.8)
    write_beside(axes, f"P{int(predicted.id[0])}", (t[-1], gap[-1]), dx=4, va="center")


def lengths_picture(record: RunRecord) -> Picture:
    """Return lengths over the undeformed cable, as Tables 5 and 6, and errors, as 7 and 8."""
    published = {m.marker: m for m in record.published}
    with canvas(3.4, columns=2 if published else 1) as (figure, (left, *right)):
        for row in record.rows:
            _stretches(left, row, published.get(row.id))
        left.set_title("length over undeformed length, %")
        left.axhline(0.0, color=FAINT, linewidth=0.8)
        _name_markers(left, record)
        for label, colour, shape in (
            *(((_ROD_AHEAD, ROD, "v"),) if record.element != "rod" else ()),
            ("predicted", PREDICTED, "o"),
            ("corrected", CORRECTED, "s"),
            ("tracked", TRACKED, "^"),
            *(
                (("published", PUBLISHED, "D"), ("paper's simulation", PAPER, "X"))
                if published
                else ()
            ),
        ):
            left.scatter([], [], color=colour, marker=shape, label=label)
        left.margins(y=0.15)
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=6)
        caption = "as Tables 5 and 6, relative to the undeformed cable; the bars span the interval."
        for axes in right:
            _error_bars(axes, record, published)
            _name_markers(axes, record)
            caption = (
                f"left: {caption} Right: as Tables 7 and 8, our prediction before and after the "
                "learned weight, beside the paper's."
            )
    return picture(figure, "Lengths and their errors", caption[0].upper() + caption[1:])


def _stretches(axes: Axes, row: MarkerRow, paper: PublishedMarker | None) -> None:
    points = (
        (row.s_fem, PREDICTED, "o", -0.24),
        (row.s_corrected, CORRECTED, "s", -0.12),
        (row.s_tracked, TRACKED, "^", 0.0),
        (row.s_rod, ROD, "v", -0.36),
        (row.s_published, PUBLISHED, "D", 0.12),
        (paper.simulation.s if paper else None, PAPER, "X", 0.24),
    )
    if row.s_low is not None and row.s_high is not None:
        ends = [100.0 * (s / row.original - 1.0) for s in (row.s_low, row.s_high)]
        axes.plot([row.id - 0.12] * 2, ends, color=CORRECTED, linewidth=5.0, alpha=0.2)
    for length, colour, shape, shift in points:
        if length is not None:
            stretch = 100.0 * (length / row.original - 1.0)
            axes.scatter([row.id + shift], [stretch], color=colour, marker=shape, s=34, zorder=3)


def _error_bars(axes: Axes, record: RunRecord, published: dict[int, PublishedMarker]) -> None:
    rows = record.rows
    bars: tuple[tuple[str, str, str, list[float | None]], ...] = (
        *(
            ((_ROD_AHEAD, ROD, "", [error_pct(row.s_published, row.s_rod) for row in rows]),)
            if record.element != "rod"
            else ()
        ),
        ("predicted", PREDICTED, "", [row.error_fem_pct for row in rows]),
        ("corrected", CORRECTED, "////", [row.error_corrected_pct for row in rows]),
        ("paper", PAPER, "....", [_paper_error(published.get(row.id), 7) for row in rows]),
        (
            "paper + DNN",
            PAPER_CORRECTED,
            "xxxx",
            [_paper_error(published.get(row.id), 8) for row in rows],
        ),
    )
    width = 0.8 / len(bars)
    for index, (label, colour, hatch, values) in enumerate(bars):
        place = [row.id + (index - 0.5 * (len(bars) - 1)) * width for row in rows]
        heights = [0.0 if value is None else value for value in values]
        axes.bar(
            place,
            heights,
            0.92 * width,
            color=colour,
            hatch=hatch,
            edgecolor="white",
            linewidth=0.0,
            label=label,
        )
        for x, value in zip(place, values, strict=True):
            if value is not None:
                write_beside(axes, f"{value:.1f}", (x, value), dy=2, ha="center", fontsize=6.5)
    axes.set_title("error against the experiment, %")
    axes.legend(loc="upper right", ncols=2)
    # Two names stand in a row of the legend.
    axes.margins(y=0.15 * math.ceil(len(bars) / 2))


def _paper_error(row: PublishedMarker | None, table: int) -> float | None:
    if row is None:
        return None
    return row.error_pct if table == 7 else row.updated_error_pct


def _name_markers(axes: Axes, record: RunRecord) -> None:
    axes.set_xticks(record.marker_ids, [f"P{marker}" for marker in record.marker_ids])
    axes.set_xlim(0.5, max(record.marker_ids, default=1) + 0.5)
    axes.grid(visible=False, axis="x")
