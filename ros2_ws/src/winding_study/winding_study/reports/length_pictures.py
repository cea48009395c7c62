"""Pictures of the lengths at the end of one run, and of their errors."""

from __future__ import annotations

from matplotlib.axes import Axes

from winding_core.cable.cases import PublishedMarker
from winding_study.documents.picture import (
    CORRECTED,
    FAINT,
    PAPER,
    PAPER_CORRECTED,
    PREDICTED,
    PUBLISHED,
    TRACKED,
    Picture,
    canvas,
    picture,
)
from winding_study.runs.run_record import MarkerRow, RunRecord


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
        figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=5)
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
                axes.annotate(
                    f"{value:.1f}",
                    (x, value),
                    xytext=(0, 2),
                    textcoords="offset points",
                    ha="center",
                    fontsize=6.5,
                )
    axes.set_title("error against the experiment, %")
    axes.legend(loc="upper right", ncols=2)
    axes.margins(y=0.3)


def _paper_error(row: PublishedMarker | None, table: int) -> float | None:
    if row is None:
        return None
    return row.error_pct if table == 7 else row.updated_error_pct


def _name_markers(axes: Axes, record: RunRecord) -> None:
    axes.set_xticks(record.marker_ids, [f"P{marker}" for marker in record.marker_ids])
    axes.set_xlim(0.5, max(record.marker_ids, default=1) + 0.5)
    axes.grid(visible=False, axis="x")
