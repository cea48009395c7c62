"""How every picture of a report looks, and how it gets into one HTML file."""

import base64
import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

INK = "#1f2933"
FAINT = "#9aa5b1"
PALE = "#cbd2d9"
GRID = "#e4e7eb"
# The palette of Okabe and Ito, distinct with any kind of colour vision; shapes and hatches carry
# the same meaning in print without colours.
PREDICTED = "#0072b2"
TRACKED = "#e69f00"
CORRECTED = "#009e73"
PUBLISHED = "#1f2933"
PAPER = "#d55e00"
PAPER_CORRECTED = "#cc79a7"
SKY = "#56b4e9"
ROD = SKY

WIDTH_INCHES = 9.2
DOTS_PER_INCH = 220  # Of what is drawn as pixels inside an SVG: sharp on paper and on dense screens
MOST_POINTS = 1500  # More points than pixels only make the file heavy
GAP = 5.0  # A pause this many times the usual interval is a gap and not a slow sample

_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "hatch.linewidth": 0.6,
    "svg.hashsalt": "winding",
}


@dataclass(frozen=True, kw_only=True)
class Picture:
    """One picture of a report."""

    title: str  # Heading above it
    caption: str  # What to see in it
    source: str  # Data URI of the SVG


@contextmanager
def canvas(
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    shared: bool = False,
    heights: Sequence[float] | None = None,
) -> Iterator[tuple[Figure, list[Axes]]]:
    """Yield a figure in the report's style with its axes, row by row.

    Args:
        height: [inch]
        rows: Of axes.
        columns: Of axes.
        shared: Whether all axes have the same limits, named at the outside only.
        heights: Of the rows, relative to each other; equal by default.
    """
    with mpl.rc_context(_STYLE):  # type: ignore[arg-type]
        figure = Figure(figsize=(WIDTH_INCHES, height), layout="constrained")
        figure.get_layout_engine().set(h_pad=0.09, w_pad=0.08)  # type: ignore[union-attr, call-arg]
        axes = (
            np.atleast_1d(
                figure.subplots(rows, columns, sharex=shared, sharey=shared, height_ratios=heights)
            )
            .ravel()
            .tolist()
        )
        yield figure, axes


def picture(figure: Figure, title: str, caption: str) -> Picture:
    """Return a figure as a picture whose bytes depend on nothing but its content."""
    stream = io.BytesIO()
    with mpl.rc_context(_STYLE):  # type: ignore[arg-type]
        figure.savefig(stream, format="svg", metadata={"Date": None}, dpi=DOTS_PER_INCH)
    encoded = base64.b64encode(stream.getvalue()).decode("ascii")
    return Picture(title=title, caption=caption, source=f"data:image/svg+xml;base64,{encoded}")


def write_beside(
    axes: Axes,
    text: str,
    at: tuple[float, float],
    *,
    dx: float = 0.0,
    dy: float = 0.0,
    **style: Any,
) -> None:
    """Write a text to the right of a place of the axes and above it, by dx and dy [points]."""
    axes.annotate(text, at, xytext=(dx, dy), textcoords="offset points", **style)


def thinned(
    t: NDArray[np.float64], value: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a signal, shape (n,), with the smallest and largest sample of each stretch."""
    if len(t) <= MOST_POINTS:
        return t, value
    parts = np.array_split(np.arange(len(t)), MOST_POINTS // 2)
    keep = np.unique(
        [
            index
            for part in parts
            for index in (part[value[part].argmin()], part[value[part].argmax()])
        ]
    )
    return t[keep], value[keep]


def broken(
    t: NDArray[np.float64], value: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a thinned signal, shape (n,), with NaN in its gaps, so that no line crosses them."""
    if len(t) < 3:
        return t, value
    intervals = np.diff(t)
    ends = np.flatnonzero(intervals > GAP * np.median(intervals)) + 1
    pieces = [
        thinned(*piece) for piece in zip(np.split(t, ends), np.split(value, ends), strict=True)
    ]
    nothing = np.array([np.nan])
    joined = [
        np.concatenate([part for piece in pieces for part in (piece[axis], nothing)][:-1])
        for axis in (0, 1)
    ]
    return joined[0], joined[1]
