"""The wound surface of a drum unrolled, layer by layer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from winding_core.lay.errors import FULL_TURN
from winding_core.units import MILLIMETRE
from winding_reports.documents.picture import (
    FAINT,
    PAPER,
    PREDICTED,
    TRACKED,
    Picture,
    canvas,
    picture,
)
from winding_reports.records.lay_outcome import LaidLine

Array = NDArray[np.float64]

_COLUMNS, _MOST = 3, 12
_HIGH = 2.6


def layers_picture(drum: Mapping[str, Any], predicted: LaidLine) -> Picture:
    """Return z over the angle around the drum, a panel for each of the newest layers.

    Args:
        drum: As `drum_outcome` returns it.
        predicted: The solver's cable at the end of the run.
    """
    layers = drum["layers"][-_MOST:]
    columns = min(_COLUMNS, len(layers))
    rows = -(-len(layers) // columns)
    low = {"low": 0.0, "high": drum["cable_diameter_m"] - drum["width_m"]}[drum["start_side"]]
    ends = np.array([low, low + drum["width_m"] - drum["cable_diameter_m"]]) / MILLIMETRE
    with canvas(_HIGH * rows + 0.4, rows=rows, columns=columns) as (figure, panels):
        for axes in panels[len(layers) :]:
            axes.set_visible(False)
        for layer, axes in zip(layers, panels, strict=False):
            _draw(axes, layer, drum["faults"], predicted)
            for end in ends:
                axes.axhline(end, color=FAINT, linewidth=0.8)
            axes.set_ylim(ends[0] - 0.1 * np.ptp(ends), ends[1] + 0.1 * np.ptp(ends))
        handles = panels[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=4)
    return picture(
        figure,
        "The wound surface, unrolled by layer",
        "z in mm over the angle around the drum; lines at top and bottom are where cable lies "
        "against a flange. Rings are gaps, climbs and missing edge turns.",
    )


def _draw(
    axes: Axes, layer: Mapping[str, Any], faults: list[Mapping[str, Any]], predicted: LaidLine
) -> None:
    theta = np.array(layer["theta_rad"])
    wanted = np.array(layer["wanted_z_m"])
    inside = (predicted.theta >= theta[0]) & (predicted.theta <= theta[-1])
    lines: tuple[tuple[Array, Array, dict[str, Any]], ...] = (
        (theta, wanted, {"color": FAINT, "linewidth": 4.0, "label": "wanted"}),
        (
            predicted.theta[inside],
            predicted.z[inside],
            {"color": PREDICTED, "linewidth": 1.2, "label": "predicted in step"},
        ),
    )
    for angle, z, style in lines:
        axes.plot(*_unrolled(angle, z), **style)
    measured = np.array(layer["measured_z_m"], dtype=float)
    dots: dict[str, Any] = {"color": TRACKED, "marker": ".", "markersize": 4, "linestyle": ""}
    axes.plot(*_unrolled(theta, measured), label="measured", **dots)
    found = [fault for fault in faults if fault["layer"] == layer["number"]]
    at = np.array([fault["theta"] for fault in found], dtype=float)
    rings: dict[str, Any] = {
        "marker": "o",
        "markersize": 11,
        "linestyle": "",
        "markerfacecolor": "none",
    }
    axes.plot(
        *_unrolled(at, np.interp(at, theta, wanted)),
        color=PAPER,
        label="gap, climb or missing edge turn",
        **rings,
    )
    share = layer["measured_share"]
    axes.set_title(f"layer {layer['number']}, {share:.0%} measured")
    axes.set_xlim(0.0, 360.0)
    axes.set_xticks([0, 90, 180, 270, 360])


def _unrolled(theta: Array, z: Array) -> tuple[Array, Array]:
    """Return angles around the drum [deg] and z [mm] of places, nan between turns."""
    angle = np.degrees(theta % FULL_TURN)
    ends = np.flatnonzero(np.diff(angle) < 0.0) + 1
    return np.insert(angle, ends, np.nan), np.insert(z / MILLIMETRE, ends, np.nan)
