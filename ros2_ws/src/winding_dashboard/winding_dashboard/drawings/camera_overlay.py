"""What is drawn over the camera's picture: frames around the bands, and the measured turns."""

import math

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.records import LayRecords
from winding_core.markers import MarkerFlag, Markers
from winding_dashboard.drawings.palette import DANGER, INK, MEASURED, PAPER
from winding_dashboard.state.camera_view import CameraView
from winding_dashboard.state.view_state import TOGETHER, ViewState

# Drawn around a band: along the cable, and beyond its surface [m].
_HALF_LENGTH = 0.0045
_MARGIN = 0.0007
_GUESSED = MarkerFlag.PREDICTED | MarkerFlag.OCCLUDED | MarkerFlag.CLIPPED
# Neighbours along the cable; farther apart something between them was not seen [rad].
_NEIGHBOURS = 0.2
# At the rim of the cylinder a turn is a sliver, and a band one behind the cable's own edge: cosines
# between surface and sight.
_LEAST_FACING, _AT_THE_RIM = 0.3, 0.15


def measured_count(markers: Markers) -> int:
    """Return how many markers were measured in the frame of the tracker's records."""
    return int(((markers["flags"] & (_GUESSED | MarkerFlag.NOT_WOUND)) == 0).sum())


def band_overlay(
    markers: Markers, view: CameraView, *, cable_radius: float, turned: float = 0.0
) -> str:
    """Return SVG that frames every band on the camera's side and names it.

    A band that was not measured in its frame is framed with dashes.

    Args:
        markers: Records of the tracker.
        view: The camera.
        cable_radius: r [m].
        turned: How far the cylinder turned from the markers' frame to the picture [rad].
    """
    parts = []
    for marker in markers:
        corners = _corners(marker, cable_radius, turned)
        if corners is None or not _facing(corners.mean(axis=0)[None], view, _AT_THE_RIM)[0]:
            continue
        pixels = view.pixels(corners)
        if not _inside(pixels, view):
            continue
        outline = " ".join(f"{u:.1f},{v:.1f}" for u, v in pixels)
        dash = ' stroke-dasharray="3 2"' if int(marker["flags"]) & _GUESSED else ""
        for colour, width in ((INK, 3.5), (MEASURED, 1.8)):
            parts.append(
                f'<polygon points="{outline}" fill="none" stroke="{colour}" '
                f'stroke-width="{width}"{dash}/>'
            )
        number = int(marker["id"])
        # Neighbouring turns nearly touch: their names stand above and below.
        u = pixels[:, 0].mean()
        v = pixels[:, 1].min() - 4.0 if number % 2 == 0 else pixels[:, 1].max() + 15.0
        v = min(max(v, 13.0), view.size[1] - 3.0)
        parts.append(
            f'<text x="{u:.1f}" y="{v:.1f}" text-anchor="middle" font-size="15" '
            f'font-weight="700" fill="{PAPER}" stroke="{INK}" stroke-width="3.5" '
            f'paint-order="stroke">P{number}</text>'
        )
    return "".join(parts)


def _corners(marker: np.void, cable_radius: float, turned: float) -> NDArray[np.float64] | None:
    x, y, z, radius = (float(marker[name]) for name in ("x", "y", "z", "r"))
    if (
        int(marker["flags"]) & MarkerFlag.NOT_WOUND
        or not np.isfinite([x, y, z, radius]).all()
        or radius <= 0
    ):
        return None
    azimuth = np.arctan2(y, x) + turned
    half = _HALF_LENGTH / radius
    across = cable_radius + _MARGIN
    return np.array(
        [
            [radius * np.cos(azimuth + a), radius * np.sin(azimuth + a), z + dz]
            for a, dz in ((-half, -across), (-half, across), (half, across), (half, -across))
        ]
    )


def _inside(pixels: NDArray[np.float64], view: CameraView) -> bool:
    width, height = view.size
    u, v = pixels.mean(axis=0)
    return bool(0.0 <= u < width and 0.0 <= v < height)


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
    pixels, shown = view.pixels(points), _facing(points, view, _LEAST_FACING)
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


def _facing(points: NDArray[np.float64], view: CameraView, least: float) -> NDArray[np.bool_]:
    outward = points * (1.0, 1.0, 0.0)
    sight = view.position - points
    scale = np.linalg.norm(outward, axis=1) * np.linalg.norm(sight, axis=1)
    facing: NDArray[np.bool_] = (outward * sight).sum(axis=1) > least * scale
    return facing


def _runs(theta: NDArray[np.float64], shown: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Return the places that are shown, in stretches without a hole."""
    places = np.flatnonzero(shown)
    holes = np.flatnonzero((np.diff(theta[places]) > _NEIGHBOURS) | (np.diff(places) > 1)) + 1
    return [run for run in np.split(places, holes) if run.size > 1]


def camera_overlay(state: ViewState) -> str:
    """Return SVG in the picture's pixels; nothing where markers are of another moment."""
    times = state.times
    if state.camera is None or not state.picture:
        return ""
    if not abs(times["picture"] - times["tracked"]) <= TOGETHER:
        return ""
    # Pictures come as seen, markers some milliseconds later; the cylinder turned meanwhile.
    bands = band_overlay(
        state.tracked,
        state.camera,
        cable_radius=state.cable_radius,
        turned=state.turned(times["tracked"], times["picture"]),
    )
    turned = state.turned(times["lay"], times["picture"])
    return lay_overlay(state.lay, state.camera, turned=turned) + bands
