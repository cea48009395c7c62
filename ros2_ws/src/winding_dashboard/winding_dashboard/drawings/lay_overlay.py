"""The measured lay of every turn on the camera's picture, as SVG made of numbers alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.records import LayRecords
from winding_dashboard.drawings.palette import DANGER, INK, PAPER
from winding_dashboard.state.camera_view import CameraView

# Neighbours along the cable; farther apart something between them was not seen [rad].
_NEIGHBOURS = 0.2
# At the rim of the cylinder a turn is a sliver: cosine between surface and sight.
_LEAST_FACING = 0.3


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
