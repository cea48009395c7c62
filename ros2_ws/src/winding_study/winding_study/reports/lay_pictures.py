"""Pictures of where the markers of one run lie, over time and on the unrolled cylinder."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw
from winding_core.units import MILLIMETRE
from winding_study.documents.picture import (
    FAINT,
    PREDICTED,
    PUBLISHED,
    TRACKED,
    Picture,
    broken,
    canvas,
    picture,
)
from winding_study.runs.run_record import MarkerSeries, RunRecord

_TURN = 2.0 * math.pi


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
        reach = max(
            [
                _last(record, name, m)[0]
                for name in ("predicted", "tracked")
                for m in record.marker_ids
            ],
            default=0.0,
        )
        published = record.published
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
                law.z(theta) / MILLIMETRE,
                color=FAINT,
                label="kinematic reference",
                zorder=1,
            )
        for name, colour, size in (("tracked", TRACKED, 90), ("predicted", PREDICTED, 36)):
            points = [_last(record, name, marker) for marker in record.marker_ids]
            known = [
                (angle / _TURN, height / MILLIMETRE) for angle, height in points if angle > 0.0
            ]
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
    axes.annotate(
        f"P{int(predicted.id[0])}",
        (t[-1], gap[-1]),
        xytext=(4, 0),
        textcoords="offset points",
        va="center",
    )
