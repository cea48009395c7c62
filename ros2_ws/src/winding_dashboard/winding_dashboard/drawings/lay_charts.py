"""Charts of the lay over turns: against the helix of the drive, or against the wanted lay."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.errors import FIRST_JUDGED, FULL_TURN, lay_errors
from winding_core.lay.records import LayFlag, LayRecords, cable_lay, name_of
from winding_core.units import MILLIMETRE
from winding_dashboard.drawings.line_chart import Band, Curve, Ends, chart, ends_of, ticks
from winding_dashboard.state.view_state import ViewState

Points = list[list[float | None]]

TURNS, _POINTS_OF_A_TURN = 12, 36  # The newest turns are drawn, and of each so many points at most
_LAYERS = 3  # Of a drum so many layers are drawn
# The upper vertical axis holds at least this [mm], the lower one this in tolerances.
_LEAST_Z, _SEEN_TOLERANCES = 5.0, 1.2
_NOISE = 0.1
_UPPER, _LOWER = (660.0, 200.0), (660.0, 150.0)
_LEAST_ERROR, _MOST_TICKS = 0.5, 12  # The axis of distances from the helix holds at least this [mm]


def helix_errors(records: LayRecords, advance: float) -> Points:
    """Return [wound turns, distance from the helix of an advance [m/rad], in mm] of every place."""
    return _points(records["theta"], records["z"] - advance * records["theta"], every=True)


def lay_drawing(records: LayRecords, advance: float) -> str:
    """Return a chart of the distance of every place from the helix of an advance [m/rad]."""
    errors = helix_errors(records, advance)
    curve = Curve(points=errors, style="is-measured", dots=True)
    turns = [turn for turn, _ in errors if turn is not None] or [0.0, 1.0]
    low, high = math.floor(min(turns)), max(math.ceil(max(turns)), math.floor(min(turns)) + 1)
    across = Ends(float(low), float(high), float(math.ceil((high - low) / _MOST_TICKS)))
    up = ends_of([curve], 0.0, -_LEAST_ERROR, _LEAST_ERROR)
    return chart([curve], across, up, size=_LOWER)


def defect_sentence(records: LayRecords) -> str:
    """Return which defects are among the records, and on which turns."""
    defects = []
    for flag in LayFlag:
        turns = np.unique(records["turn"][(records["flags"] & flag) > 0]).tolist()
        if turns:
            defects.append(f"{name_of(flag)} on turn {', '.join(str(turn + 1) for turn in turns)}")
    return "; ".join(defects)


def control_drawings(state: ViewState, tolerance: float) -> dict[str, str]:
    """Return the lay and its deviation, one above the other on one axis of turns.

    Args:
        state: With a controller that is known.
        tolerance: Half width of the band [m].

    Returns:
        The insides of two SVG elements by their ids.
    """
    wound = state.control.wanted.end / FULL_TURN
    last = max(1, math.ceil(wound - 1.0e-6))
    first = max(0, last - TURNS)
    curves = {name: _within(points, first) for name, points in lay_curves(state).items()}
    limit = tolerance / MILLIMETRE
    band = _SEEN_TOLERANCES * limit
    lay = [
        Curve(points=curves["wanted"], style="is-set dashed"),
        Curve(points=curves["predicted"], style="is-predicted"),
        Curve(points=curves["measured"], style="is-measured", dots=True),
    ]
    off = [
        Curve(points=curves["predicted off"], style="is-predicted"),
        Curve(points=curves["measured off"], style="is-measured", dots=True),
    ]
    z = [y for curve in lay for _, y in curve.points if y is not None] or [0.0]
    # What is missing behind P0 is no reason for an axis below zero.
    bottom = min(z) if min(z) < -_NOISE * max(z) else 0.0
    across = Ends(float(first), float(last), float(math.ceil((last - first) / TURNS)))
    begin = max(first, FIRST_JUDGED - 1)
    return {
        "chart-lay": chart(lay, across, ticks(bottom, max(z), _LEAST_Z), size=_UPPER),
        "chart-off": chart(
            off,
            across,
            ends_of(off, 0.0, -band, band),
            size=_LOWER,
            bands=[Band(x=(begin, last), y=(-limit, limit))] if begin < last else [],
        ),
    }


def layers_drawing(state: ViewState) -> str:
    """Return the newest layers on a drum unrolled: z, mm, over the angle around the drum.

    Colours take turns from layer to layer; rings are where something is wrong.
    """
    control, lines, begins = state.control, lay_curves(state), state.control.layer_turns
    newest = int(np.searchsorted(begins, control.wanted.end / FULL_TURN))
    rings = control.faults[control.faults >= FULL_TURN * begins[max(newest - _LAYERS, 0)]]
    found = _points(rings, control.wanted.at(rings), every=True)
    curves = [Curve(points=_around(found), style="is-fault", dots=True)]
    for layer in range(max(newest - _LAYERS, 0), min(newest, len(begins) - 1)):
        first, last = begins[layer], begins[layer + 1]
        style = f"layer-{layer % _LAYERS + 1}"
        for name, how in (("wanted", " dashed"), ("predicted", " thin"), ("measured", "")):
            own = [point for point in lines[name] if first <= (point[0] or 0.0) < last]
            for turn in sorted({math.floor(point[0] or 0.0) for point in own}):
                part = [point for point in own if math.floor(point[0] or 0.0) == turn]
                curves.append(
                    Curve(points=_around(part), style=style + how, dots=name == "measured")
                )
    return chart(curves, Ends(0.0, 360.0, 90.0), ends_of(curves, _LEAST_Z), size=_UPPER, unit="°")


def _around(points: Points) -> Points:
    """Return points over turns over the angle around the drum [deg]."""
    return [[360.0 * ((turn or 0.0) % 1.0), z] for turn, z in points]


def lay_curves(state: ViewState) -> dict[str, Points]:
    """Return [turns, mm] of every curve by its name."""
    control, wanted = state.control, state.control.wanted
    angle, radius = state.drum_angle, state.centreline_radius
    theta, z = np.zeros(0), np.zeros(0)
    if math.isfinite(angle) and math.isfinite(radius):
        theta, z = cable_lay(state.cable, angle, radius)
    places = state.lay
    return {
        "wanted": _points(wanted.theta, wanted.z) if control.known else [],
        "predicted": _points(theta, z),
        "measured": _points(places["theta"], places["z"]),
        "predicted off": _points(theta, z - wanted.at(theta)),
        "measured off": _points(places["theta"], lay_errors(places, wanted)),
    }


def _points(theta: NDArray[Any], z: NDArray[Any], *, every: bool = False) -> Points:
    """Return [turns, mm] of what is known, thinned where it is dense unless every place counts."""
    turns, height = np.asarray(theta, float) / FULL_TURN, np.asarray(z, float) / MILLIMETRE
    known = np.isfinite(turns) & np.isfinite(height)
    turns, height = turns[known], height[known]
    if turns.size and not every:
        span = max(float(np.ptp(turns)), 1.0)
        step = math.ceil(turns.size / (_POINTS_OF_A_TURN * span))
        turns, height = turns[::step], height[::step]
    return [[x, y] for x, y in zip(turns.round(3).tolist(), height.round(3).tolist(), strict=True)]


def _within(points: Points, first: float) -> Points:
    return [point for point in points if point[0] is not None and point[0] >= first]
