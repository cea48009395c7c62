"""Pictures of a study: lengths and errors as Tables 5 to 8, models of h, network, classifier."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, ScalarFormatter
from numpy.typing import NDArray

from correction_node.training.comparison import BASELINE, ORACLE
from winding_core.cable.cases import PublishedMarker, paper_case, published_markers
from winding_core.units import MILLIMETRE
from winding_reports.documents.data_table import DataTable
from winding_reports.documents.picture import (
    CORRECTED,
    FAINT,
    GRID,
    INK,
    PAPER,
    PAPER_CORRECTED,
    PREDICTED,
    PUBLISHED,
    SKY,
    TRACKED,
    Picture,
    canvas,
    picture,
    write_beside,
)
from winding_study.paper.paper_tables import model_order
from winding_study.paper.study_record import StudyRecord

Array = NDArray[np.float64]
Cell = tuple[int, int]
# Title of a series, colour, shape, filled, error by cell.
Series = tuple[str, str, str, bool, Mapping[Cell, float]]

_TICKS = (0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 60.0)
_PANELS_PER_ROW = 6
_LEGEND_POINTS = 24.0  # Between a title and its axes, for the legend
# Wider than the step between two markers of one case.
_BETWEEN_CASES = 1.2
PAPER_ACCURACY_PCT = 91.3
# Nodes of each layer, inputs and output included (section 4).
PAPER_NETWORK = (3, 10, 10, 10, 1)
_BAR = 0.38


def errors_picture(record: StudyRecord) -> Picture:
    """Return the errors of every measured cell before and after the correction."""
    rows, printed = _measured(record), record.printed_pct
    raw: list[Series] = [("paper's simulation", PAPER, "X", True, printed(7))]
    if record.config is not None:
        errors = {(c.case, c.marker): c.error_pct for c in record.comparison.cells}
        raw.append((record.who, PREDICTED, "o", True, errors))
    updated: list[Series] = [("paper, in-sample", PAPER_CORRECTED, "X", True, printed(8))]
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


def models_picture(record: StudyRecord) -> Picture:
    """Return the error of every model, in-sample beside leave-one-case-out."""
    models = sorted(record.models.items(), key=model_order)
    longest = max(
        value
        for _, model in models
        for value in (model.in_sample_pct, model.leave_one_case_out_pct)
        if math.isfinite(value)
    )
    with canvas(0.42 * len(models) + 1.3) as (figure, (axes,)):
        for row, (_, model) in enumerate(models):
            colour = {ORACLE: FAINT, BASELINE: PREDICTED}.get(model.kind, CORRECTED)
            apart = 0.5 * _BAR if math.isfinite(model.leave_one_case_out_pct) else 0.0
            for value, spread, shift, seen in (
                (model.in_sample_pct, model.in_sample_spread_pct, -apart, True),
                (model.leave_one_case_out_pct, model.leave_one_case_out_spread_pct, apart, False),
            ):
                if not math.isfinite(value):
                    continue
                axes.barh(
                    row + shift,
                    value,
                    0.92 * _BAR,
                    color="white" if seen else colour,
                    edgecolor=colour,
                    hatch="////" if seen else "",
                    linewidth=0.9,
                    xerr=0.5 * spread if spread > 0.0 else None,
                    error_kw={"ecolor": INK, "elinewidth": 1.0, "capsize": 2.0},
                )
                # The paper's line must not run through a number.
                box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
                end = value + 0.5 * max(spread, 0.0), row + shift
                write_beside(axes, f"{value:.2f}", end, dx=4, va="center", fontsize=7.5, bbox=box)
        paper = record.paper_updated_pct()
        axes.axvline(paper, color=PAPER_CORRECTED, linewidth=1.4, linestyle=(0, (5, 3)))
        label, top = f"paper's network, in-sample: {paper:.2f} %", ("data", "axes fraction")
        at = paper, 1.0
        write_beside(axes, label, at, dy=3, xycoords=top, ha="left", fontsize=8.0, color=INK)
        axes.set_yticks(range(len(models)), [name for name, _ in models])
        axes.invert_yaxis()
        axes.set_xlim(0.0, 1.12 * longest)
        axes.set_xlabel("mean error of a length over the measured cells, %")
        axes.grid(visible=False, axis="y")
        axes.barh([0], [0], color="white", edgecolor=FAINT, hatch="////", label="in-sample")
        axes.barh([0], [0], color=FAINT, label="its case left out")
        for label, colour in (("learned", CORRECTED), ("plain", PREDICTED), ("floor", FAINT)):
            axes.scatter([], [], marker="s", color=colour, label=label)
        figure.legend(loc="outside lower center", ncols=5)
    return picture(
        figure,
        "Models of the weight h",
        "Every model learned from all cases (hatched) and predicting a case that it never saw "
        "(full). Only the second holds for a new cable. Whiskers: largest minus "
        "smallest over the seeds. The floor is one h per case chosen with the answer known.",
    )


def neighbours_picture(table: DataTable) -> Picture:
    """Return the K-NN's accuracy against simulated noise, both in percent.

    Args:
        table: Noise in the first column, accuracy by kind of noise in the others.
    """
    noise, *kinds = [column.name for column in table.columns]
    with canvas(2.9) as (figure, (axes,)):
        axes.axhline(PAPER_ACCURACY_PCT, color=PAPER, linewidth=1.4, linestyle=(0, (5, 3)))
        right = ("axes fraction", "data")
        end = 1.0, PAPER_ACCURACY_PCT
        write_beside(axes, "paper: up to 91.3 %", end, dy=3, xycoords=right, ha="right")
        styles = ((PREDICTED, "o", "-"), (TRACKED, "s", "--"), (CORRECTED, "^", ":"))
        for kind, (colour, shape, line) in zip(kinds, styles, strict=False):
            axes.plot(
                table.numbers(noise),
                table.numbers(kind),
                color=colour,
                marker=shape,
                linestyle=line,
                label=kind,
            )
        axes.set_ylim(0.0, 105.0)
        axes.set_xlim(left=0.0)
        axes.set_xlabel(f"simulated {noise}")
        axes.set_title("runs whose condition is named rightly, %")
        axes.legend(loc="lower left")
    return picture(
        figure,
        "K-nearest neighbours against simulated noise",
        "Simulated: the paper's ten repetitions of each case were not published, so runs are "
        "drawn around the published lengths.",
    )


def network_picture() -> Picture:
    """Return the paper's Figure 11: the network from the condition to the updated length."""
    layers = PAPER_NETWORK
    names = ("cylinder diameter", "cable diameter", "tension")
    tallest = max(layers)
    with canvas(3.6) as (figure, (axes,)):
        places = [
            [(float(column), 0.5 * (count - 1) - node) for node in range(count)]
            for column, count in enumerate(layers)
        ]
        for left, right in pairwise(places):
            for x0, y0 in left:
                for x1, y1 in right:
                    axes.plot([x0, x1], [y0, y1], color=GRID, linewidth=0.6, zorder=1)
        last = len(layers) - 1
        for column, nodes in enumerate(places):
            colour = SKY if 0 < column < last else TRACKED if column == 0 else CORRECTED
            for x, y in nodes:
                axes.scatter([x], [y], s=110, color=colour, edgecolors="white", zorder=2)
        for name, (x, y) in zip(names, places[0], strict=True):
            axes.text(x - 0.12, y, name, ha="right", va="center")
        for column in range(1, last):
            axes.text(column, 0.5 * tallest + 0.3, f"{layers[column]} × ReLU", ha="center")
        axes.text(last + 0.1, 0.0, "h", va="center", fontsize=13.0, style="italic")
        axes.annotate(
            "",
            (last + 0.75, 0.0),
            xytext=(last + 0.25, 0.0),
            arrowprops={"arrowstyle": "-|>", "color": INK},
        )
        axes.text(last + 0.8, 0.0, "$h \\cdot S_{FEM}$", va="center", fontsize=11.0)
        axes.text(
            last + 0.1,
            -0.5 * tallest + 0.4,
            "loss: $MSE(h\\,S_{FEM} - S_{EXP})$",
            va="center",
            ha="left",
        )
        axes.set_xlim(-1.1, last + 1.9)
        axes.set_ylim(-0.5 * tallest - 0.3, 0.5 * tallest + 0.9)
        axes.set_axis_off()
    return picture(
        figure,
        "Figure 11: the network that updates the length",
        "Three inputs, three hidden layers, one weight h for the whole case; the predicted "
        "length of every marker is multiplied by it.",
    )
