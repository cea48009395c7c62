"""Picture of the wound cables of all cases, as the paper's Figure 9."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from winding_core.cases import paper_case
from winding_core.units import MILLIMETRE
from winding_study.documents.picture import INK, PALE, Picture, canvas, picture
from winding_study.runs.case_result import CaseResult

Array = NDArray[np.float64]

# In order of brightness also when printed grey, and safe for any kind of colour vision.
_COLOURS = "viridis_r"
_MARKER_YELLOW = "#f0e442"
# Points drawn for each node, so that turns look round.
_FINE = 6
_SPAN_MM = 26.0
_MARGIN_MM = 8.0
_ABOVE_MM = 14.0
# Of the drawing; three cables of 110 mm fill the width of a page.
_MM_PER_INCH = 40.0
_COLUMNS = 3


def cables_picture(results: tuple[CaseResult, ...]) -> Picture:
    """Return every case at its end, seen from the side, its cable coloured by strain.

    Args:
        results: At least one case.
    """
    columns = min(_COLUMNS, len(results))
    lines = -(-len(results) // columns)
    strains = [100.0 * _wound_strain(result) for result in results]
    scale = Normalize(0.0, max(5.0, *(float(s.max()) for s in strains)))
    tall = [
        max(_height_mm(result) for result in results[row * columns : (row + 1) * columns])
        for row in range(lines)
    ]
    high = sum(tall) / _MM_PER_INCH + 0.45 * lines + 0.9
    with canvas(high, rows=lines, columns=columns, heights=tall) as (figure, panels):
        for axes in panels[len(results) :]:
            axes.set_visible(False)
        for result, axes in zip(results, panels, strict=False):
            drawn = _draw(axes, result, scale)
        bar = figure.colorbar(
            drawn, ax=panels, orientation="horizontal", fraction=0.025, aspect=60, pad=0.02
        )
        bar.set_label("axial strain of the cable, %")
        bar.outline.set_visible(False)
    return picture(
        figure,
        "Figure 9: the wound cables",
        "Seen from the side at the end of the run, to scale, z in mm; what lies behind is "
        "drawn pale, markers are yellow dots. As in the paper the cable stretches less the "
        "thicker it is. Mean strain on the cylinder: "
        + ", ".join(
            f"case {result.case} {strain.mean():.1f} %"
            for result, strain in zip(results, strains, strict=True)
        )
        + ".",
    )


def _wound_strain(result: CaseResult) -> Array:
    """Strain of what lies on the cylinder, shape (k,)."""
    distance = np.hypot(result.nodes[:, 0], result.nodes[:, 1])
    loose = distance > 1.02 * paper_case(result.case).centreline_radius
    wound = int(np.argmax(loose)) if loose.any() else len(loose)
    return result.strain[1 : max(2, wound)]


def _height_mm(result: CaseResult) -> float:
    """Height of what is drawn of a case."""
    return paper_case(result.case).cylinder_diameter / MILLIMETRE + _SPAN_MM + _ABOVE_MM


def _draw(axes: Axes, result: CaseResult, scale: Normalize) -> PolyCollection:
    case = paper_case(result.case)
    fine = np.linspace(0.0, len(result.nodes) - 1.0, _FINE * len(result.nodes))
    x, y, z, strain = _smooth(result, fine)
    radius, width = case.cylinder_radius / MILLIMETRE, case.cable_diameter / MILLIMETRE
    long = float(z.max()) + _MARGIN_MM
    axes.add_patch(
        Rectangle(
            (-_MARGIN_MM, -radius),
            long + _MARGIN_MM,
            2.0 * radius,
            color=PALE,
            alpha=0.8,
            linewidth=0.0,
            zorder=2,
        )
    )
    edges = _edges(z, y, 0.5 * width)
    front = x[:-1] + x[1:] >= 0.0
    drawn = _ribbon(axes, edges, strain, ~front, scale, alpha=0.4, zorder=1)
    drawn = _ribbon(axes, edges, strain, front, scale, alpha=1.0, zorder=3)
    _markers(axes, result)
    axes.set_aspect("equal")
    axes.set_xlim(-_MARGIN_MM, long)
    axes.set_ylim(-radius - _SPAN_MM, radius + _ABOVE_MM)
    axes.grid(visible=False)
    axes.set_yticks([])
    axes.tick_params(labelsize=7.0)
    axes.spines["left"].set_visible(False)
    axes.set_title(
        f"{case.number}:  {2.0 * radius:g} / {width:g} mm, {case.weight:.1f} N", fontsize=8.5
    )
    return drawn


def _smooth(result: CaseResult, place: Array) -> tuple[Array, Array, Array, Array]:
    """Return x, y, z [mm] and strain between the nodes, along circles about the axis."""
    nodes = np.arange(len(result.nodes))
    azimuth = np.unwrap(np.arctan2(result.nodes[:, 1], result.nodes[:, 0]))
    distance = np.hypot(result.nodes[:, 0], result.nodes[:, 1]) / MILLIMETRE
    angle, radius = np.interp(place, nodes, azimuth), np.interp(place, nodes, distance)
    z = np.interp(place, nodes, result.nodes[:, 2] / MILLIMETRE)
    return (
        radius * np.cos(angle),
        radius * np.sin(angle),
        z,
        np.interp(place, nodes, result.strain),
    )


def _edges(across: Array, up: Array, half: float) -> Array:
    """Return both edges of a band along a line, shape (n, 2 edges, 2)."""
    line = np.column_stack([across, up])
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1.0e-12)
    normal = half * np.column_stack([-tangent[:, 1], tangent[:, 0]])
    return np.stack([line + normal, line - normal], axis=1)


def _ribbon(
    axes: Axes,
    edges: Array,
    strain: Array,
    shown: NDArray[np.bool_],
    scale: Normalize,
    *,
    alpha: float,
    zorder: int,
) -> PolyCollection:
    quads = np.stack([edges[:-1, 0], edges[1:, 0], edges[1:, 1], edges[:-1, 1]], axis=1)
    band = PolyCollection(
        list(quads[shown]),
        array=100.0 * strain[:-1][shown],
        cmap=_COLOURS,
        norm=scale,
        edgecolors="face",
        linewidths=0.3,
        alpha=alpha,
        zorder=zorder,
        rasterized=True,
    )
    axes.add_collection(band)
    return band


def _markers(axes: Axes, result: CaseResult) -> None:
    """Draw P0 to Pn where they lie; the names stand above the cylinder."""
    case = paper_case(result.case)
    start = math.atan2(result.nodes[0, 1], result.nodes[0, 0])
    places = {0: (0.0, 0.0)} | {n: (lay.theta, lay.z) for n, lay in result.lays.items()}
    for marker, (theta, z) in places.items():
        front = math.cos(start - theta) >= 0.0
        along = (result.nodes[0, 2] + z) / MILLIMETRE
        axes.scatter(
            [along],
            [case.centreline_radius * math.sin(start - theta) / MILLIMETRE],
            s=20,
            color=_MARKER_YELLOW,
            edgecolors=INK,
            linewidths=0.7,
            alpha=1.0 if front else 0.5,
            zorder=4,
        )
        axes.annotate(
            f"P{marker}",
            (along, (case.cylinder_radius + case.cable_diameter) / MILLIMETRE),
            xytext=(0, 2),
            textcoords="offset points",
            # The first marker lies close to the tied one.
            ha="right" if marker == 0 else "center",
            fontsize=6.5,
            color=INK,
        )
