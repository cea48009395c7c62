"""The measured lay of every turn: on the camera's picture, and against the commanded helix."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from nicegui import ui
from numpy.typing import NDArray

from winding_core.lay_records import LayFlag, LayRecords, name_of
from winding_core.units import MILLIMETRE
from winding_dashboard.views.elements import heading
from winding_dashboard.views.palette import DANGER, INK, LINE, MEASURED, PAPER, SOFT
from winding_dashboard.views.projection import CameraView

# Neighbours along the cable; farther apart something between them was not seen [rad].
_NEIGHBOURS = 0.2
# At the rim of the cylinder a turn is a sliver: cosine between surface and sight.
_LEAST_FACING = 0.3
# The vertical axis holds at least this [mm].
_LEAST_ERROR = 0.5


def lay_overlay(records: LayRecords, view: CameraView, *, turned: float = 0.0) -> str:
    """Return SVG of the cable's measured centreline on the camera's side.

    What lies wrongly has a ring around it.

    Args:
        records: Of LAY_DTYPE.
        view: The camera.
        turned: How far the cylinder turned from the records' frame to the picture [rad].
    """
    if not len(records):
        return ""
    points = np.stack([records[name].astype(float) for name in "xyz"], axis=1)
    c, s = math.cos(turned), math.sin(turned)
    points[:, :2] = points[:, :2] @ np.array([[c, s], [-s, c]])
    pixels, shown = view.pixels(points), _facing(points, view)
    parts = []
    for run in _runs(records["theta"], shown):
        line = " ".join(f"{u:.1f},{v:.1f}" for u, v in pixels[run])
        for colour, width in ((INK, 2.4), (PAPER, 1.0)):
            parts.append(
                f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="{width}"/>'
            )
    for u, v in pixels[shown & (records["flags"] > 0)]:
        parts.append(
            f'<circle cx="{u:.1f}" cy="{v:.1f}" r="5" fill="none" stroke="{DANGER}" '
            'stroke-width="2"/>'
        )
    return "".join(parts)


def lay_errors(records: LayRecords, advance: float) -> list[list[float]]:
    """Return [wound turns, distance from the helix of an advance [m/rad], in mm] of every place."""
    error = (records["z"] - advance * records["theta"]) / MILLIMETRE
    turns = records["theta"] / math.tau
    known = np.isfinite(error)
    return [
        [float(turn), float(off)]
        for turn, off in zip(turns[known].round(3), error[known].round(3), strict=True)
    ]


class LayChart:
    """Distance of every turn from the commanded helix; there once a lay is measured."""

    def __init__(self) -> None:
        title = "Lay: distance from the commanded helix, mm"
        section = ui.element("section").classes("card lay")
        with section.props(f'aria-label="Chart: {title}"') as card:
            self._card = card
            with ui.element("div").classes("heading-row"):
                heading(title)
                self._defects = ui.label().classes("remark")
            self._chart = ui.echart(_options()).classes("chart")
        card.set_visibility(False)
        self._shown: tuple[float, int] = (math.nan, 0)

    def hide(self) -> None:
        """Leave the chart out."""
        self._card.set_visibility(False)

    def update(self, t: float, records: LayRecords, advance: float) -> None:
        """Draw the lay of time t [s] if it is another one than shown; advance is in m/rad."""
        shown = (t, len(records))
        if shown == self._shown:
            return
        self._shown = shown
        self._card.set_visibility(len(records) > 0)
        options = self._chart.options
        errors = lay_errors(records, advance) if math.isfinite(advance) else []
        options["series"][0]["data"] = errors
        if errors:
            turns, values = zip(*errors, strict=True)
            options["xAxis"] |= {"min": math.floor(min(turns)), "max": math.ceil(max(turns))}
            options["yAxis"] |= {
                "min": min(-_LEAST_ERROR, math.floor(min(values))),
                "max": max(_LEAST_ERROR, math.ceil(max(values))),
            }
        self._defects.set_text(defects_told(records))
        self._chart.update()


def defects_told(records: LayRecords) -> str:
    """Return which defects are among the records, and on which turns."""
    told = []
    for flag in LayFlag:
        turns = np.unique(records["turn"][(records["flags"] & flag) > 0]).tolist()
        if turns:
            told.append(f"{name_of(flag)} on turn {', '.join(str(turn + 1) for turn in turns)}")
    return "; ".join(told)


def _facing(points: NDArray[np.float64], view: CameraView) -> NDArray[np.bool_]:
    outward = points * (1.0, 1.0, 0.0)
    sight = view.position - points
    scale = np.linalg.norm(outward, axis=1) * np.linalg.norm(sight, axis=1)
    facing: NDArray[np.bool_] = (outward * sight).sum(axis=1) > _LEAST_FACING * scale
    return facing


def _runs(theta: NDArray[np.float64], shown: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Return the places that are shown, in stretches without a hole."""
    places = np.flatnonzero(shown)
    holes = np.flatnonzero((np.diff(theta[places]) > _NEIGHBOURS) | (np.diff(places) > 1)) + 1
    return [run for run in np.split(places, holes) if run.size > 1]


def _options() -> dict[str, Any]:
    axis = {
        "type": "value",
        "axisLabel": {"color": SOFT, "fontSize": 11},
        "splitLine": {"lineStyle": {"color": LINE}},
        "axisLine": {"lineStyle": {"color": SOFT}},
    }
    return {
        "animation": False,
        "grid": {"left": 46, "right": 14, "top": 12, "bottom": 36},
        "xAxis": {**axis, "name": "wound turns", "nameLocation": "middle", "nameGap": 22},
        "yAxis": axis,
        "series": [
            {
                "type": "scatter",
                "symbolSize": 4,
                "silent": True,
                "itemStyle": {"color": MEASURED},
                "data": [],
            }
        ],
    }
