"""From the buffer of a run to what became of its wanted lay."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np

from lay_control_node.ros.parameters import LayControlParameters
from winding_core.cable.cases import Case
from winding_core.cable.condition import Condition
from winding_core.lay.drum_parameters import DrumShape
from winding_core.lay.layers import WoundDrum
from winding_core.lay.records import LAY_DTYPE, LayControlRecords, LayRecords, cable_lay
from winding_core.markers import MARKER_DTYPE, is_wound
from winding_core.parameters import Value, build, declared_in
from winding_recorder.live.run_buffer import RunBuffer
from winding_reports.records.lay_outcome import (
    LaidLine,
    LaidRun,
    LayOutcome,
    drum_outcome,
    lay_outcome,
)
from winding_reports.records.run_record import MarkerSeries, WoundCable
from winding_ros import topics
from winding_study.paper.case_result import MOST_NODES

_BEGIN = 0.05  # The cable is complete once it reaches P0 [rad]


def recorded_outcome(
    buffer: RunBuffer,
    condition: Condition,
    tracked: MarkerSeries,
    wish: Mapping[str, Value],
    tolerance: float,
    status: Mapping[str, str],
) -> LayOutcome | None:
    """Return what became of a run's lay; None for a run without a controller of it.

    Args:
        buffer: The run's messages.
        condition: What was wound.
        tracked: Markers of the camera.
        wish: Parameters of the wanted lay.
        tolerance: For every turn after the second [m].
        status: Values of the controller's last diagnostics.
    """
    control = [records for _, records in buffer.readings(topics.LAY_CONTROL_STATE)]
    if not control:
        return None
    what = condition.resolved()
    radius = what.case.centreline_radius
    wanted = _wanted(condition, wish)
    wound = None if wanted is None else wanted.filling(what)
    states = np.concatenate(control)
    places = _last_lay(buffer) if wound is None else _every_place(buffer, wound, states)
    run = LaidRun(
        control=states,
        places=places,
        predicted=_predicted(buffer, radius),
        ahead=_ahead(buffer),
        landed={
            int(number): float(tracked.of(number).theta.mean()) for number in np.unique(tracked.id)
        },
    )
    markers = {} if wanted is None else wanted.wanted(what).markers
    outcome = lay_outcome(run, what, tolerance=tolerance, markers=markers)
    if wound is None:
        return outcome
    faults = json.loads(status.get("layer_faults", "[]"))
    return replace(outcome, drum=drum_outcome(wound, run.control, places, faults))


def _every_place(buffer: RunBuffer, wound: WoundDrum, states: LayControlRecords) -> LayRecords:
    """Return each place as it was measured last: later layers hide those below."""
    theta, first = np.unique(states["theta"], return_index=True)
    newest: dict[float, LayRecords] = {}
    for _, places in buffer.readings(topics.TRACKED_LAY):
        landed = np.interp(places["theta"], theta, states["z"][first])
        for place in wound.in_place(places, landed):
            newest[float(place["theta"])] = place
    found: LayRecords = np.array(list(newest.values()), dtype=LAY_DTYPE)
    return found


def _last_lay(buffer: RunBuffer) -> LayRecords:
    found: LayRecords = np.zeros(0, LAY_DTYPE)
    for _, places in buffer.readings(topics.TRACKED_LAY):
        found = places if len(places) else found
    return found


def _predicted(buffer: RunBuffer, radius: float) -> LaidLine:
    """Return the solver's whole cable; the newest message has its newest turns alone."""
    readings = list(buffer.axis_readings())
    stamps = np.array([t for t, _ in readings])
    angles = np.array([reading.cylinder_angle for _, reading in readings])
    theta, z = np.zeros(0), np.zeros(0)
    for t, cable in reversed(list(buffer.readings(topics.FEM_CABLE))):
        if not stamps.size:
            break
        further, height = cable_lay(cable, float(np.interp(t, stamps, angles)), radius)
        older = further < (theta[0] if theta.size else np.inf)
        if older.any():
            theta = np.concatenate([further[older], theta])
            z = np.concatenate([height[older], z])
        if theta.size and theta[0] < _BEGIN:
            break
    return LaidLine(theta=theta, z=z)


def _ahead(buffer: RunBuffer) -> LaidLine:
    newest = buffer.newest(topics.FEM_PREDICTION)
    last = np.zeros(0, MARKER_DTYPE) if newest is None else newest
    wound = last[is_wound(last)]
    order = np.argsort(wound["theta"])
    return LaidLine(theta=wound["theta"][order].astype(float), z=wound["z"][order].astype(float))


def _wanted(condition: Condition, wish: Mapping[str, Value]) -> LayControlParameters | None:
    """Return what was wanted; None where an operator has wound what has no such program."""
    try:
        wanted = build(LayControlParameters, {**asdict(condition), **wish}, owner="the run")
        wanted.wanted(condition.resolved())
    except ValueError:
        return None
    return wanted


def last_cable(buffer: RunBuffer, case: Case, wish: Mapping[str, Value]) -> WoundCable | None:
    """Return the cable as the solver published it last; None where it published none.

    Of a long run that is the span and the newest turns.
    """
    records, markers = buffer.newest(topics.FEM_CABLE), buffer.newest(topics.FEM_MARKERS)
    if records is None or len(records) < 2:
        return None
    keep = np.unique(np.linspace(0, records.size - 1, min(records.size, MOST_NODES)).astype(int))
    whole = float(records["s"][0]) < float(records["s"][1] - records["s"][0])
    marks = {0: (0.0, 0.0)} if whole else {}
    if markers is not None and whole:
        wound = markers[is_wound(markers)]
        marks |= {int(m["id"]): (float(m["theta"]), float(m["z"])) for m in wound}
    return WoundCable(
        case=case,
        nodes=np.column_stack([records[axis][keep] for axis in "xyz"]).astype(float),
        strain=records["strain"][keep].astype(float),
        marks=marks,
        drum=DrumShape(**declared_in(DrumShape, wish)).drum(case),
    )
