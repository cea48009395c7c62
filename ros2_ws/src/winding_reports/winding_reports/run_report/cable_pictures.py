"""Pictures of wound cables: of all cases, as the paper's Figure 9, and of one run."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from winding_core.units import MILLIMETRE
from winding_reports.documents.picture import (
    FAINT,
    INK,
    PALE,
    Picture,
    canvas,
    picture,
    write_beside,
)
from winding_reports.records.run_record import WoundCable

Array = NDArray[np.float64]

# In order of brightness also when printed grey, and safe for any kind of colour vision.
_COLOURS = "viridis_r"
_MARKER_YELLOW = "#f0e442"
# Points drawn for each node, so that turns look round.
_FINE = 6
_SPAN_MM = 26.0
_MARGIN_MM = 8.0
_ABOVE_MM = 14.0
_FLANGE_MM = 3.0
# Of the drawing; three cables of 110 mm fill the width of a page.
_MM_PER_INCH = 40.0
_COLUMNS = 3
_HOW_TO_READ = (
    "Seen from the side at the end of the run, to scale, z in mm; what lies behind is drawn pale, "
    "markers are yellow dots."
)


def cables_picture(cables: list[WoundCable]) -> Picture:
    """Return every case at its end, seen from the side, its cable coloured by strain."""
    strains = ", ".join(
        f"case {cable.case.number} {100.0 * cable.wound_strain.mean():.1f} %" for cable in cables
    )
    return _picture(
        cables,
        "Figure 9: the wound cables",
        f"{_HOW_TO_READ} As in the paper the cable stretches less the thicker it is. Mean strain "
        f"on the cylinder: {strains}.",
    )


def cable_picture(cable: WoundCable) -> Picture:
    """Return the predicted cable of a run at its end, coloured by strain."""
    return _picture(
        [cable],
        "The wound cable",
        f"As the solver predicts it. {_HOW_TO_READ} Mean strain on the cylinder: "
        f"{100.0 * cable.wound_strain.mean():.1f} %.",
    )


def _picture(cables: list[WoundCable], title: str, caption: str) -> Picture:
    columns = min(_COLUMNS, len(cables))
    lines = -(-len(cables) // columns)
    scale = Normalize(0.0, max(5.0, *(100.0 * float(c.wound_strain.max()) for c in cables)))
    tall = [
        max(float(np.ptp(_reach_mm(cable))) for cable in cables[row * columns :][:columns])
        for row in range(lines)
    ]
    high = sum(tall) / _MM_PER_INCH + 0.45 * lines + 0.9
    with canvas(high, rows=lines, columns=columns, heights=tall) as (figure, panels):
        for axes in panels[len(cables) :]:
            axes.set_visible(False)
        for cable, axes in zip(cables, panels, strict=False):
            drawn = _draw(axes, cable, scale)
        bar = figure.colorbar(
            drawn, ax=panels, orientation="horizontal", fraction=0.025, aspect=60, pad=0.02
        )
        bar.set_label("axial strain of the cable, %")
        bar.outline.set_visible(False)
    return picture(figure, title, caption)


def _reach_mm(cable: WoundCable) -> tuple[float, float]:
    """Lower and upper end of what is drawn of a cable."""
    radius, flange = cable.case.cylinder_radius / MILLIMETRE, _MARGIN_MM
    flange += 0.0 if cable.drum is None else cable.drum.flange_height / MILLIMETRE
    return -radius - max(_SPAN_MM, flange), radius + max(_ABOVE_MM, flange)


def _draw(axes: Axes, cable: WoundCable, scale: Normalize) -> PolyCollection:
    case = cable.case
    fine = np.linspace(0.0, len(cable.nodes) - 1.0, _FINE * len(cable.nodes))
    x, y, z, strain = _smooth(cable, fine)
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
    if cable.drum is not None:
        ends = np.array(cable.drum.inner_faces(case.cable_diameter)) / MILLIMETRE
        begin = cable.nodes[0, 2] / MILLIMETRE if 0 in cable.marks else 0.0
        outer = cable.drum.flange_radius / MILLIMETRE
        for left in (begin + ends[0] - _FLANGE_MM, begin + ends[1]):
            flange = Rectangle((left, -outer), _FLANGE_MM, 2.0 * outer, color=FAINT, zorder=2)
            axes.add_patch(flange)
        long = max(long, float(begin + ends[1]) + _MARGIN_MM)
    edges = _edges(z, y, 0.5 * width)
    front = x[:-1] + x[1:] >= 0.0
    drawn = _ribbon(axes, edges, strain, ~front, scale, alpha=0.4, zorder=1)
    drawn = _ribbon(axes, edges, strain, front, scale, alpha=1.0, zorder=3)
    _markers(axes, cable)
    axes.set_aspect("equal")
    axes.set_xlim(-_MARGIN_MM, long)
    axes.set_ylim(*_reach_mm(cable))
    axes.grid(visible=False)
    axes.set_yticks([])
    axes.tick_params(labelsize=7.0)
    axes.spines["left"].set_visible(False)
    name = f"{case.number}:  " if case.number else ""
    axes.set_title(f"{name}{2.0 * radius:g} / {width:g} mm, {case.weight:.1f} N", fontsize=8.5)
    return drawn


def _smooth(cable: WoundCable, place: Array) -> tuple[Array, Array, Array, Array]:
    """Return x, y, z [mm] and strain between the nodes, along circles about the axis."""
    nodes = np.arange(len(cable.nodes))
    azimuth = np.unwrap(np.arctan2(cable.nodes[:, 1], cable.nodes[:, 0]))
    distance = np.hypot(cable.nodes[:, 0], cable.nodes[:, 1]) / MILLIMETRE
    angle, radius = np.interp(place, nodes, azimuth), np.interp(place, nodes, distance)
    z = np.interp(place, nodes, cable.nodes[:, 2] / MILLIMETRE)
    return (
        radius * np.cos(angle),
        radius * np.sin(angle),
        z,
        np.interp(place, nodes, cable.strain),
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


def _markers(axes: Axes, cable: WoundCable) -> None:
    """Draw P0 to Pn where they lie; the names stand above the cylinder."""
    case = cable.case
    start = math.atan2(cable.nodes[0, 1], cable.nodes[0, 0])
    for marker, (theta, z) in cable.marks.items():
        front = math.cos(start - theta) >= 0.0
        along = (cable.nodes[0, 2] + z) / MILLIMETRE
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
        above = along, (case.cylinder_radius + case.cable_diameter) / MILLIMETRE
        # The first marker lies close to the tied one.
        aligned = "right" if marker == 0 else "center"
        write_beside(axes, f"P{marker}", above, dy=2, ha=aligned, fontsize=6.5, color=INK)
