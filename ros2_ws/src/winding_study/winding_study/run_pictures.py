"""Pictures of one run: machine, tension, lay, lengths and their errors."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from cable_winding.cases import Case
from cable_winding.fleet import PAPER_FREE_LENGTH, FleetAngleLaw
from cable_winding.published import MILLIMETRE, PublishedMarker, published_markers
from winding_study.picture import (
    CORRECTED,
    FAINT,
    PAPER,
    PREDICTED,
    PUBLISHED,
    TRACKED,
    Picture,
    canvas,
    picture,
    thinned,
)
from winding_study.run_record import MarkerRow, MarkerSeries, RunRecord, Signal

_TURN = 2.0 * math.pi


def speeds_picture(record: RunRecord) -> Picture:
    """Return both speeds against their targets, the paper's Figure 7, and what is between them."""
    drive = record.drive
    with canvas(4.6, rows=2, columns=2) as (figure, (cylinder, carriage, *gaps)):
        for axes, measured, setpoint, scale, label in (
            (cylinder, record.cylinder_speed, record.cylinder_setpoint, 1.0, "cylinder, rad/s"),
            (carriage, record.carriage_speed, record.carriage_setpoint, 1e3, "carriage, mm/s"),
        ):
            axes.plot(*_scaled(setpoint, scale), color=FAINT, linewidth=3.0, label="target")
            axes.plot(*_scaled(measured, scale), color=PREDICTED, linewidth=0.8, label="measured")
            axes.set_title(label)
            axes.legend(loc="lower right")
        for axes, measured, target in (
            (gaps[0], record.cylinder_speed, drive.angular_speed),
            (gaps[1], record.carriage_speed, drive.feed_speed),
        ):
            axes.axhline(0.0, color=FAINT, linewidth=3.0)
            held = measured.t >= drive.ramp_time
            if target > 0.0 and held.any():
                gap = 100.0 * (measured.value[held] / target - 1.0)
                axes.plot(*thinned(measured.t[held], gap), color=PREDICTED, linewidth=0.8)
            axes.set_title("off target after the ramp, %")
            axes.set_xlabel("time, s")
        for axes in (cylinder, carriage, *gaps):
            axes.set_xlim(0.0, _end(record))
    return picture(
        figure,
        "Speeds against their targets",
        "As the paper's Figure 7. After the ramp the cylinder is off its target by "
        f"{tracking(record.cylinder_speed, drive.angular_speed, drive.ramp_time)}, the carriage by "
        f"{tracking(record.carriage_speed, drive.feed_speed, drive.ramp_time)}.",
    )


def tracking(measured: Signal, target: float, ramp_time: float) -> str:
    """Return how closely a speed is held after the ramp, in words."""
    held = measured.value[measured.t >= ramp_time]
    if len(held) == 0 or target == 0.0:
        return "an unknown amount"
    rms = 100.0 * float(np.sqrt(np.mean((held / target - 1.0) ** 2)))
    peak = 100.0 * max(0.0, float(held.max()) / target - 1.0)
    return f"{rms:.2f} % rms (highest sample {peak:.1f} % above it)"


def tension_picture(record: RunRecord) -> Picture:
    """Return the load cell over time beside the dead weight."""
    weight = record.case.weight
    with canvas(2.3) as (figure, (axes,)):
        axes.axhline(weight, color=FAINT, linewidth=3.0, label="dead weight")
        axes.plot(*_scaled(record.tension, 1.0), color=PREDICTED, linewidth=0.8, label="load cell")
        axes.set_title("tension, N")
        axes.set_xlabel("time, s")
        axes.set_xlim(0.0, _end(record))
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.95 * weight), max(high, 1.05 * weight))
        axes.legend(loc="lower right", ncols=2)
    caption = "Force in the span between guide and cylinder; the axis does not begin at zero."
    if len(record.tension.value):
        caption += (
            f" Mean {record.tension.value.mean():.3f} N, standard deviation "
            f"{1e3 * record.tension.value.std():.1f} mN."
        )
    return picture(figure, "Tension", caption)


def marker_picture(record: RunRecord) -> Picture:
    """Return theta and z of predicted and tracked markers over time, and their difference."""
    with canvas(5.6, rows=2, columns=2) as (figure, (theta, z, dtheta, dz)):
        for marker in _ids(record):
            predicted, tracked = record.predicted.of(marker), record.tracked.of(marker)
            for axes, name, scale in ((theta, "theta", 1.0 / _TURN), (z, "z", 1e3)):
                for series, colour, width in ((tracked, TRACKED, 3.0), (predicted, PREDICTED, 1.2)):
                    axes.plot(
                        *thinned(series.t, scale * getattr(series, name)),
                        color=colour,
                        linewidth=width,
                        solid_capstyle="butt",
                    )
                last = predicted if len(predicted.t) else tracked
                if len(last.t):
                    axes.annotate(
                        f"P{marker}",
                        (last.t[-1], getattr(last, name)[-1] * scale),
                        xytext=(4, 0),
                        textcoords="offset points",
                        va="center",
                    )
            for axes, name, scale in ((dtheta, "theta", 1e3), (dz, "z", 1e3)):
                _difference(axes, predicted, tracked, name, scale)
        for axes, title in (
            (theta, "wound angle, turns"),
            (z, "axial position, mm"),
            (dtheta, "predicted - tracked angle, mrad"),
            (dz, "predicted - tracked position, mm"),
        ):
            axes.set_title(title)
            axes.set_xlim(0.0, _end(record))
        for axes in (dtheta, dz):
            axes.set_xlabel("time, s")
            axes.axhline(0.0, color=FAINT, linewidth=0.8)
        theta.plot([], [], color=TRACKED, linewidth=3.0, label="tracked")
        theta.plot([], [], color=PREDICTED, linewidth=1.2, label="predicted")
        theta.legend(loc="upper left")
    return picture(
        figure,
        "Markers over time",
        "A line begins where its marker comes to lie on the cylinder; a level line is a marker "
        "that stays where it was laid.",
    )


def lay_picture(record: RunRecord) -> Picture:
    """Return the lay on the unrolled cylinder."""
    with canvas(3.4) as (figure, (axes,)):
        reach = max(
            [_last(record, name, m)[0] for name in ("predicted", "tracked") for m in _ids(record)],
            default=0.0,
        )
        published = published_markers(record.case.number) if record.case.number else ()
        reach = max([reach, *(row.experiment.theta for row in published if row.experiment)])
        if reach > 0.0 and record.drive.feed_speed > 0.0:
            law = FleetAngleLaw(
                advance_per_radian=record.drive.advance_per_radian,
                free_length=PAPER_FREE_LENGTH,
                radius=record.case.centreline_radius,
            )
            theta = np.linspace(0.0, 1.05 * reach, 200)
            axes.plot(
                theta / _TURN,
                1e3 * law.z(theta),
                color=FAINT,
                label="kinematic reference",
                zorder=1,
            )
        for name, colour, size in (("tracked", TRACKED, 90), ("predicted", PREDICTED, 36)):
            points = [_last(record, name, marker) for marker in _ids(record)]
            known = [(angle / _TURN, 1e3 * height) for angle, height in points if angle > 0.0]
            if known:
                turns, heights = zip(*known, strict=True)
                axes.scatter(turns, heights, s=size, color=colour, label=name, zorder=2)
        measured = [row.experiment for row in published if row.experiment]
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
        axes.legend(loc="upper left")
    return picture(
        figure,
        "The lay on the unrolled cylinder",
        "Where each marker lies at the end of the run. The line is the no-slip, quasi-static "
        "reference for one guide distance.",
    )


def lengths_picture(record: RunRecord) -> Picture:
    """Return lengths over the undeformed cable, as Tables 5 and 6, and errors, as 7 and 8."""
    published = {m.marker: m for m in _published(record.case)}
    with canvas(3.4, columns=2) as (figure, (left, right)):
        for row in record.rows:
            _stretches(left, row, published.get(row.id))
        left.set_title("length over undeformed length, %")
        left.axhline(0.0, color=FAINT, linewidth=0.8)
        _name_markers(left, record)
        for label, colour, shape in (
            ("predicted", PREDICTED, "o"),
            ("corrected", CORRECTED, "s"),
            ("tracked", TRACKED, "^"),
            ("published", PUBLISHED, "D"),
            ("paper's simulation", PAPER, "X"),
        ):
            left.scatter([], [], color=colour, marker=shape, label=label)
        left.margins(y=0.15)
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=5)
        bars = (
            ("predicted", PREDICTED, [row.error_fem_pct for row in record.rows]),
            ("corrected", CORRECTED, [row.error_corrected_pct for row in record.rows]),
            ("paper", PAPER, [_paper_error(published.get(row.id), 7) for row in record.rows]),
            ("paper + DNN", FAINT, [_paper_error(published.get(row.id), 8) for row in record.rows]),
        )
        if published:
            _error_bars(right, bars)
        else:
            right.text(0.5, 0.5, "no published experiment", ha="center", transform=right.transAxes)
        right.set_title("error against the experiment, %")
        _name_markers(right, record)
    return picture(
        figure,
        "Lengths and their errors",
        "Left as Tables 5 and 6, each S_n relative to the undeformed cable; bars span s_low to "
        "s_high. Right as Tables 7 and 8, our prediction before and after the learned weight "
        "beside the paper's.",
    )


def _stretches(axes: Axes, row: MarkerRow, paper: PublishedMarker | None) -> None:
    points = (
        (row.s_fem, PREDICTED, "o", -0.24),
        (row.s_corrected, CORRECTED, "s", -0.12),
        (row.s_tracked, TRACKED, "^", 0.0),
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


def _error_bars(axes: Axes, bars: tuple[tuple[str, str, list[float | None]], ...]) -> None:
    width = 0.8 / len(bars)
    for index, (label, colour, values) in enumerate(bars):
        place = [n + 1 + (index - 0.5 * (len(bars) - 1)) * width for n in range(len(values))]
        heights = [0.0 if value is None else value for value in values]
        axes.bar(place, heights, 0.92 * width, color=colour, label=label)
        for x, value in zip(place, values, strict=True):
            if value is not None:
                axes.annotate(
                    f"{value:.1f}",
                    (x, value),
                    xytext=(0, 2),
                    textcoords="offset points",
                    ha="center",
                    fontsize=6.5,
                )
    axes.legend(loc="upper right", ncols=2)
    axes.margins(y=0.3)


def _paper_error(row: PublishedMarker | None, table: int) -> float | None:
    if row is None:
        return None
    return row.error_pct if table == 7 else row.updated_error_pct


def _published(case: Case) -> tuple[PublishedMarker, ...]:
    return published_markers(case.number) if case.number else ()


def _ids(record: RunRecord) -> list[int]:
    return [row.id for row in record.rows]


def _name_markers(axes: Axes, record: RunRecord) -> None:
    axes.set_xticks(_ids(record), [f"P{marker}" for marker in _ids(record)])
    axes.grid(visible=False, axis="x")


def _end(record: RunRecord) -> float:
    stamps = [series.t for series in (record.predicted, record.tracked) if len(series.t)]
    latest = max((float(t.max()) for t in stamps), default=1.0)
    return max(latest, record.sim_s or 0.0)


def _last(record: RunRecord, name: str, marker: int) -> tuple[float, float]:
    series: MarkerSeries = getattr(record, name).of(marker)
    return (float(series.theta[-1]), float(series.z[-1])) if len(series.t) else (0.0, 0.0)


def _scaled(signal: Signal, scale: float) -> tuple[np.ndarray, np.ndarray]:
    return thinned(signal.t, scale * signal.value)


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
    axes.plot(*thinned(t, gap), color=PREDICTED, linewidth=0.8)
    axes.annotate(
        f"P{int(predicted.id[0])}",
        (t[-1], gap[-1]),
        xytext=(4, 0),
        textcoords="offset points",
        va="center",
    )
