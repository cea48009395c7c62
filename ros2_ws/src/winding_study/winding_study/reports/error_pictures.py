"""Pictures of every measured cell: lengths as Tables 5 and 6, errors as Tables 7 and 8."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, ScalarFormatter
from numpy.typing import NDArray

from winding_core.cable.cases import PublishedMarker, paper_case, published_markers
from winding_core.units import MILLIMETRE
from winding_study.documents.picture import (
    CORRECTED,
    FAINT,
    PAPER,
    PAPER_CORRECTED,
    PREDICTED,
    PUBLISHED,
    Picture,
    canvas,
    picture,
)
from winding_study.paper.study_record import StudyRecord

Array = NDArray[np.float64]
Cell = tuple[int, int]
# Title of a series, colour, shape, filled, error by cell.
Series = tuple[str, str, str, bool, Mapping[Cell, float]]

_TICKS = (0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 60.0)
_PANELS_PER_ROW = 6
# Between a title and its axes, for the legend.
_LEGEND_POINTS = 24.0
# Wider than the step between two markers of one case.
_BETWEEN_CASES = 1.2


def errors_picture(record: StudyRecord) -> Picture:
    """Return the errors of every measured cell before and after the correction."""
    rows = _measured(record)
    raw: list[Series] = [("paper's simulation", PAPER, "X", True, _printed(rows, 7))]
    if record.config is not None:
        errors = {(c.case, c.marker): c.error_pct for c in record.comparison.cells}
        raw.append((record.who, PREDICTED, "o", True, errors))
    updated: list[Series] = [("paper, in-sample", PAPER_CORRECTED, "X", True, _printed(rows, 8))]
    best = record.best_learned
    if best is not None:
        model = record.models[best]
        seen, unseen = record.errors_pct(model.in_sample), record.errors_pct(model.held_out)
        updated.append((f"{best}, in-sample", CORRECTED, "s", False, seen))
        updated.append((f"{best}, its case left out", CORRECTED, "o", True, unseen))
    with canvas(5.8, rows=2) as (figure, (above, below)):
        for axes, series in ((above, raw), (below, updated)):
            _cells(axes, rows, series)
        above.set_title("Table 7: error of the prediction, %", pad=_LEGEND_POINTS)
        below.set_title("Table 8: error after the learned weight, %", pad=_LEGEND_POINTS)
        below.set_xlabel("case of Table 1; in each case P1 to P4 from left to right")
    means = "; ".join(
        f"{name} {sum(errors.values()) / len(errors):.2f} %" for name, *_, errors in raw + updated
    )
    return picture(
        figure,
        "Tables 7 and 8: errors of every measured length",
        "Both scales are square roots, so that small errors stay apart; each vertical line joins "
        f"the numbers of one marker. Means: {means}.",
    )


def stretches_picture(record: StudyRecord) -> Picture:
    """Return how much longer every length is than the undeformed cable, case by case."""
    count = len(record.cases)
    columns = min(count, _PANELS_PER_ROW)
    lines = -(-count // columns)
    own = {(c.case, c.marker): c.s_m for c in record.comparison.cells}
    corrected: Mapping[Cell, float] = {}
    best = record.best_learned
    if best is not None:
        h = record.models[best].held_out
        corrected = {
            (cell.case, cell.marker): float(factor) * cell.s_fem
            for cell, factor in zip(record.cells, h, strict=True)
        }
    with canvas(2.2 * lines + 0.6, rows=lines, columns=columns, shared=True) as (figure, panels):
        for axes in panels[count:]:
            axes.set_visible(False)
        for number, axes in zip(record.cases, panels, strict=False):
            rows = published_markers(number)
            _stretch(axes, rows, {r.marker: r.simulation.s for r in rows}, PAPER, "X", "paper")
            if record.config is not None:
                ours = {m: s for (case, m), s in own.items() if case == number}
                _stretch(axes, rows, ours, PREDICTED, "o", record.who)
            left_out = {m: s for (case, m), s in corrected.items() if case == number}
            _stretch(axes, rows, left_out, CORRECTED, "s", f"{best}, case left out")
            measured = {r.marker: r.experiment.s for r in rows if r.experiment}
            _stretch(axes, rows, measured, PUBLISHED, "D", "experiment")
            case = paper_case(number)
            axes.set_title(
                f"{number}:  {case.cylinder_diameter / MILLIMETRE:g} / "
                f"{case.cable_diameter / MILLIMETRE:g} mm, {case.weight:.1f} N",
                fontsize=8.0,
            )
            axes.set_xticks(range(1, 5), [f"P{n}" for n in range(1, 5)])
            axes.axhline(0.0, color=FAINT, linewidth=0.8)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        figure.supylabel("length over undeformed length, %", fontsize=9.0)
    return picture(
        figure,
        "Tables 5 and 6: how much longer the cable gets",
        "One panel for each case: number, diameter of cylinder and cable, dead weight. The "
        "paper's simulated column carries little of the material: its markers lie a turn apart "
        "whatever the cable.",
    )


def _cells(axes: Axes, rows: Sequence[PublishedMarker], series: Sequence[Series]) -> None:
    place: dict[Cell, float] = {}
    for index, row in enumerate(rows):
        between = _BETWEEN_CASES * len({before.case for before in rows[:index]} - {row.case})
        place[row.case, row.marker] = index + between
    for cell, x in place.items():
        values = [errors[cell] for *_, errors in series if cell in errors]
        if len(values) > 1:
            axes.plot([x, x], [min(values), max(values)], color=FAINT, linewidth=0.8, zorder=1)
    for name, colour, shape, filled, errors in series:
        known = [cell for cell in place if cell in errors]
        axes.scatter(
            [place[cell] for cell in known],
            [errors[cell] for cell in known],
            marker=shape,
            s=30,
            facecolors=colour if filled else "white",
            edgecolors=colour,
            linewidths=1.1,
            label=name,
            zorder=3,
        )
    numbers = sorted({case for case, _ in place})
    middle = {n: [x for (case, _), x in place.items() if case == n] for n in numbers}
    axes.set_xticks([sum(xs) / len(xs) for xs in middle.values()], [str(n) for n in numbers])
    axes.set_yscale("function", functions=(_root, np.square))
    axes.yaxis.set_major_locator(FixedLocator(_TICKS))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    highest = max(error for *_, errors in series for error in errors.values())
    axes.set_ylim(0.0, 1.1 * highest)
    axes.grid(visible=False, axis="x")
    axes.margins(x=0.015)
    axes.legend(loc="lower left", ncols=3, bbox_to_anchor=(0.0, 1.0), borderpad=0.0)


def _root(values: Array) -> Array:
    return np.asarray(np.sqrt(np.maximum(values, 0.0)))


def _stretch(
    axes: Axes,
    rows: Sequence[PublishedMarker],
    lengths: Mapping[int, float],
    colour: str,
    shape: str,
    label: str,
) -> None:
    if not lengths:
        return
    original = {row.marker: row.original_length for row in rows}
    axes.plot(
        list(lengths),
        [100.0 * (s / original[marker] - 1.0) for marker, s in lengths.items()],
        color=colour,
        marker=shape,
        markersize=4.5,
        linewidth=1.0,
        label=label,
    )


def _measured(record: StudyRecord) -> list[PublishedMarker]:
    asked = set(record.comparison.keys)
    return [row for row in published_markers() if (row.case, row.marker) in asked]


def _printed(rows: Sequence[PublishedMarker], table: int) -> dict[Cell, float]:
    errors = {
        (row.case, row.marker): row.error_pct if table == 7 else row.updated_error_pct
        for row in rows
    }
    return {cell: error for cell, error in errors.items() if error is not None}
