"""Pictures of what can be learned: models side by side, the paper's network, its classifier."""

from __future__ import annotations

import math
from itertools import pairwise

from correction_node.training.comparison import BASELINE, ORACLE, ModelScore
from winding_study.documents.data_table import DataTable
from winding_study.documents.picture import (
    CORRECTED,
    FAINT,
    GRID,
    INK,
    PAPER,
    PAPER_CORRECTED,
    PREDICTED,
    SKY,
    TRACKED,
    Picture,
    canvas,
    picture,
)
from winding_study.paper.study_record import StudyRecord
from winding_study.paper.study_tables import model_order

PAPER_ACCURACY_PCT = 91.3
# Nodes of each layer, inputs and output included (section 4).
PAPER_NETWORK = (3, 10, 10, 10, 1)
_BAR = 0.38


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
            colour = _colour(model)
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
                axes.annotate(
                    f"{value:.2f}",
                    (value + 0.5 * (spread if spread > 0.0 else 0.0), row + shift),
                    xytext=(4, 0),
                    textcoords="offset points",
                    va="center",
                    fontsize=7.5,
                    bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
                )
        paper = record.paper_updated_pct()
        axes.axvline(paper, color=PAPER_CORRECTED, linewidth=1.4, linestyle=(0, (5, 3)))
        axes.annotate(
            f"paper's network, in-sample: {paper:.2f} %",
            (paper, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="left",
            fontsize=8.0,
            color=INK,
        )
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
        "(full). Only the second says what happens with a new cable. Whiskers: largest minus "
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
        axes.annotate(
            "paper: up to 91.3 %",
            (1.0, PAPER_ACCURACY_PCT),
            xycoords=("axes fraction", "data"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right",
        )
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


def _colour(model: ModelScore) -> str:
    return {ORACLE: FAINT, BASELINE: PREDICTED}.get(model.kind, CORRECTED)
