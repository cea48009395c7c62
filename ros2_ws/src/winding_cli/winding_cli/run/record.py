"""From the buffer of a run to the numbers of its report and its table."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.winding.winding_config import SolverParameters
from correction_node.models.factor_models import ProcessModel
from correction_node.models.weights import load_factor, weights_directory
from winding_cli.run.laid_cable import last_cable, recorded_outcome
from winding_cli.run.outcome import run_outcome
from winding_core.arm.opening import open_arm
from winding_core.cable.cases import published_markers
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.helix import curve_length
from winding_core.machine.readings import AxisReading
from winding_core.markers import MarkerFlag, is_wound
from winding_core.parameters import Value, declarations, declared_in
from winding_core.run_options import OperatorLimits, SolverOptions
from winding_core.run_outcome import Extent
from winding_recorder.live.run_buffer import RunBuffer
from winding_reports.records.identity import (
    Identity,
    Origin,
    condition_quantities,
    declared_quantities,
)
from winding_reports.records.run_record import MarkerRow, MarkerSeries, RunRecord, Signal
from winding_reports.trace import length_trace
from winding_ros import topics
from winding_ros.graph import RIG, parameters_of
from winding_ros.topic import Topic
from winding_supervisor.session.session import RunResult

# A marker in one of these states was not measured in that frame.
_UNSEEN = int(
    MarkerFlag.NOT_WOUND | MarkerFlag.PREDICTED | MarkerFlag.OCCLUDED | MarkerFlag.CLIPPED
)

_THINNED = (
    "The run was long: of what came before its last seconds, curves and means have every second "
    "message, or every fourth, and so on. Nothing is missing from the counts of frames and samples."
)

_BESIDE_THE_ROD = (
    "The solid predicted in step with the machine. The rod's lengths beside it were wound ahead of "
    "the run, as it was planned and under the dead weight. The shipped weights were trained on the "
    "rod's predictions and on the paper's: what h corrects here is another prediction."
)


def run_record(
    condition: Condition,
    result: RunResult,
    wish: Mapping[str, Value],
    limits: OperatorLimits,
    *,
    asked: Extent,
    parameters: Mapping[str, Mapping[str, object]],
    origin: Origin | None = None,
) -> RunRecord:
    """Return the record of a finished run.

    Args:
        condition: What was wound.
        result: What the run left.
        wish: Parameters of the wanted lay, if there was one.
        limits: Of that lay, in every turn after the second, and of the corrected lengths.
        asked: How far the run was to go.
        parameters: Of every node, by node.
        origin: The process that made the run; None where a recording does not state it.
    """
    buffer = result.buffer
    what = condition.resolved()
    case = what.case
    measured = [(t - buffer.origin, reading) for t, reading in buffer.axis_readings()]
    commanded = _in_run(buffer, topics.JOINT_COMMANDS)
    tension = _in_run(buffer, topics.TENSION)
    tracked = _series(buffer, topics.TRACKED_MARKERS, unseen=_UNSEEN)
    predicted = _series(buffer, topics.FEM_MARKERS, unseen=MarkerFlag.NOT_WOUND)
    corrected = _series(buffer, topics.CORRECTED_MARKERS)
    begin = round(1e9 * buffer.origin)
    frames = buffer.stamps(topics.CAMERA_INFO) - begin
    answered = buffer.stamps(topics.TRACKED_MARKERS) - begin
    joints = buffer.stamps(topics.JOINT_STATES) - begin
    published = published_markers(case.number) if case.is_published else ()
    experiment = {item.marker: item.experiment.s for item in published if item.experiment}
    final = _final_corrections(buffer)
    corrected_by = _last_status(buffer, topics.CORRECTION)
    weights, digest = (corrected_by.get(key, "") for key in ("weights", "weights_sha256"))
    held_out = _held_out(weights, digest, what)
    solver = SolverParameters(**declared_in(SolverOptions, parameters.get(topics.FEM, {})))
    config = solver.config_of(what)
    rod = MarkerSeries.empty()
    if solver.element != "rod":
        rod = _series(buffer, topics.FEM_PREDICTION, unseen=MarkerFlag.NOT_WOUND)
    ahead = dict(zip(rod.id.tolist(), rod.s.tolist(), strict=True))
    reached = buffer.time
    missing = _gaps
    if result.simulated:
        completed = result.ending.cause is None
        # One that was stopped and resumed has taken longer than was planned.
        planned = max(condition.duration, reached)
        missing = partial(_missing, duration=planned if completed else reached)
    rig = _rig_parameters(parameters)
    # A simulated machine may lay the cable where the paper's experiment measured it, which is the
    # measure of its lengths then.
    laid_as_published = rig.get("lay") == "paper"
    controller = _last_status(buffer, topics.LAY_CONTROL)
    lay = recorded_outcome(buffer, condition, tracked, wish, limits.lay_tolerance, controller)
    published_lay = case.is_published and lay is None and laid_as_published
    rows = tuple(
        MarkerRow(
            id=marker,
            original=case.original_length(marker),
            **_mean_place(tracked.of(marker), case.centreline_radius),
            s_published=experiment.get(marker),
            h_held_out=(held_out or {}).get(marker) if marker in final else None,
            s_rod=ahead.get(marker),
            **_corrected(final.get(marker)),
        )
        for marker in range(1, case.marker_count + 1)
    )
    arm, undrawn = _arm_links(str(rig.get("machine_file", "")), what, measured)
    return RunRecord(
        arm=arm,
        case=case,
        drive=what.drive,
        cylinder_speed=_signal(measured, attrgetter("angular_speed")),
        carriage_speed=_signal(measured, attrgetter("feed_speed")),
        cylinder_setpoint=_signal(commanded, attrgetter("angular_speed")),
        carriage_setpoint=_signal(commanded, attrgetter("feed_speed")),
        tension=_signal(tension, float),
        predicted=predicted,
        tracked=tracked,
        corrected=corrected,
        rows=rows,
        outcome=run_outcome(
            result,
            condition,
            asked,
            rows,
            lay,
            published=published_lay,
            error_limit_pct=limits.error_limit_pct,
        ),
        frames=len(answered),
        frames_lost=missing(frames, topics.CAMERA_INFO) + len(np.setdiff1d(frames, answered)),
        joint_states=len(joints),
        joint_states_lost=missing(joints, topics.JOINT_STATES),
        # A recording does not state how long its run took.
        wall_s=result.wall_s or None,
        sim_s=reached,
        facts=_facts(buffer, corrected_by),
        trace=None if result.trace is None else length_trace(result.trace),
        lay=lay,
        identity=Identity(
            origin=origin,
            seeds=(rig["seed"],) if rig else (),
            bags=tuple(str(bag.absolute()) for bag in result.bags),
            weights=weights,
            weights_sha256=digest,
            condition=condition_quantities(condition)
            | declared_quantities(
                SolverOptions,
                vars(solver)
                | {"segment_length": config.resolved.segment, "mass_scaling": config.mass_scaling},
            ),
        ),
        cable=last_cable(buffer, case, wish),
        material=buffer.newest(topics.FEM_MATERIAL),
        element=solver.element,
        rod=rod,
        notes=(
            *_notes(
                published=case.is_published,
                controlled=lay is not None,
                laid_as_published=laid_as_published,
                unseen=held_out == {},
            ),
            *([] if solver.element == "rod" else [_BESIDE_THE_ROD]),
            *([_THINNED] if buffer.thinned else []),
            *undrawn,
        ),
    )


def _rig_parameters(parameters: Mapping[str, Mapping[str, object]]) -> dict[str, Any]:
    """Return what the simulated machine was set to; nothing of a real one."""
    if topics.RIG not in parameters:
        return {}
    own = {item.name: item.default for item in declarations(parameters_of(RIG))}
    return {**own, **parameters[topics.RIG]}


def _mean_place(series: MarkerSeries, radius: float) -> dict[str, float]:
    """Return a marker's mean place over all frames that show it, and the length there [m]."""
    if series.t.size == 0:
        return {}
    theta, z = float(series.theta.mean()), float(series.z.mean())
    return {
        "s_tracked": curve_length(radius, theta, z),
        "theta_tracked": theta,
        "z_tracked": z,
        # Frames share most of their error: a mean is no better than its frames are stated to be.
        "sigma_theta": float(np.median(series.sigma_theta)),
        "sigma_z": float(np.median(series.sigma_z)),
    }


def _in_run(buffer: RunBuffer, topic: Topic) -> list[tuple[float, Any]]:
    """Return the readings of a topic, by the time since the run began."""
    return [(t - buffer.origin, value) for t, value in buffer.readings(topic)]


def _signal(readings: Sequence[tuple[float, Any]], of: Callable[[Any], float]) -> Signal:
    return Signal(
        t=np.array([t for t, _ in readings]),
        value=np.array([of(reading) for _, reading in readings]),
    )


def _series(buffer: RunBuffer, topic: Topic, unseen: int = 0) -> MarkerSeries:
    stamps, rows = [], []
    for t, markers in _in_run(buffer, topic):
        seen = markers[((markers["flags"] & unseen) == 0) & np.isfinite(markers["s"])]
        rows.append(seen)
        stamps.append(np.full(len(seen), t))
    if not rows:
        return MarkerSeries.empty()
    return MarkerSeries.of_records(np.concatenate(stamps), np.concatenate(rows))


def _arm_links(
    file: str, what: ResolvedCondition, measured: list[tuple[float, AxisReading]]
) -> tuple[NDArray[np.float64] | None, list[str]]:
    """Return the arm at the first and the last place of its eye, and why it is not drawn."""
    try:
        path = open_arm(file, what)
        if path is None or not measured:
            return None, []
        joints = path.start
        for _, reading in measured[:: max(1, len(measured) // 50)] + measured[-1:]:
            joints = path.joints_at(reading.carriage_position, joints)
    except ValueError as error:
        # A recording outlives the file of its arm.
        return None, [f"The arm is not drawn: {error}."]
    return np.array([path.links(path.start), path.links(joints)]), []


def _missing(stamps: NDArray[np.int64], topic: Topic, duration: float) -> int:
    """Return how many of the instants 0, 1/rate, ... duration have no message."""
    assert topic.rate is not None
    instants = np.round(np.arange(int(duration * topic.rate + 1e-9) + 1) * (1e9 / topic.rate))
    return len(np.setdiff1d(instants.astype(np.int64), stamps))


def _gaps(stamps: NDArray[np.int64], _topic: Topic) -> int:
    """Return how many messages the gaps between stamps would hold, at the usual period."""
    steps = np.diff(stamps)
    if len(steps) == 0:
        return 0
    return int(np.maximum(np.round(steps / np.median(steps)) - 1.0, 0.0).sum())


def _final_corrections(buffer: RunBuffer) -> dict[int, np.void]:
    markers = buffer.newest(topics.CORRECTED_MARKERS)
    if markers is None:
        return {}
    return {int(marker["id"]): marker for marker in markers[is_wound(markers)]}


def _corrected(correction: np.void | None) -> dict[str, float]:
    """Return what a marker's row has of its correction, lengths in metres; nothing without one."""
    if correction is None:
        return {}
    fields = {"s_fem": "s_fem", "h": "h", "s_corrected": "s", "s_low": "s_low", "s_high": "s_high"}
    return {name: float(correction[own]) for name, own in fields.items()}


def _facts(buffer: RunBuffer, corrected: Mapping[str, str]) -> dict[str, str]:
    facts = {}
    votes = buffer.newest(topics.CORRECTION_CASE)
    if votes:
        case, share = next(iter(votes.items()))
        facts["resembles"] = f"case {case}, {share:.0%} of the votes"
    if "weights" in corrected:
        facts["trained weight"] = corrected["weights"]
        if "learned_from" in corrected:
            facts["learned from"] = corrected["learned_from"]
            facts["condition"] = corrected["condition"]
        facts["its mean error over all cases"] = (
            f"{corrected['in_sample_pct']} % in-sample, "
            f"{corrected['leave_one_case_out_pct']} % with each case left out"
        )
    solver = _last_status(buffer, topics.FEM)
    if "energy_balance_pct" in solver:
        facts["solver's energy balance"] = f"open by {solver['energy_balance_pct']} %"
    return facts


def _last_status(buffer: RunBuffer, name: str) -> Mapping[str, str]:
    """Return the values of the last diagnostics of a node."""
    found: Mapping[str, str] = {}
    for status in buffer.statuses():
        if status.name == name:
            found = status.values
    return found


def _notes(
    *, published: bool, controlled: bool, laid_as_published: bool, unseen: bool
) -> tuple[str, ...]:
    tracked = (
        "The tracked lengths are measured by the camera in this run: each marker's mean place "
        "over all frames that show it."
    )
    if not published:
        return (tracked, "The condition is not published: there is no experiment beside it.")
    if controlled:
        return (
            tracked,
            "The cable lies where the machine's own motion and pull laid it. The published "
            "experiment was wound at a constant feed under a dead weight: it is no measure of a "
            "lay that was controlled.",
        )
    if not laid_as_published:
        return (
            tracked,
            "The cable lies where this machine laid it: the camera's lengths are the measure. The "
            "published experiment stands beside them and is no measure of another machine's lay.",
        )
    return (
        tracked,
        "The machine lays the cable where the paper's experiment measured it, so the tracked "
        "lengths test the camera and the tracker, not the solver.",
        "The weight h was trained on published cases without this one: its error here is one of a "
        "case held out, but for the build-up length within a run, which was learned from all."
        if unseen
        else "The weight h was trained on all twelve published cases, this one among them: its "
        "error here is in-sample. Held out is the prediction times the factor of a training that "
        "never saw this case, without what was measured in this run.",
    )


def _held_out(weights: str, digest: str, what: ResolvedCondition) -> dict[int, float] | None:
    """Return h by marker of the training that never saw the run's case.

    Empty where these weights never saw it; None where it is not published or that is not known.

    Args:
        weights: Shipped name or folder; empty for a run without a correction.
        digest: SHA-256 of its numbers; empty where the run did not state it.
        what: What was wound.
    """
    number = what.case.number
    if not (digest and number):
        return None
    try:
        trained = load_factor(weights_directory(weights))
    except (OSError, ValueError):
        # A recording may outlive the folder of its weights.
        return None
    if trained.card["weights_sha256"] != digest or trained.factor(what.case, what.law).outside:
        return None
    by_case: Any = trained.card.get("h_left_out", {})
    if str(number) not in by_case and by_case and not isinstance(trained.model, ProcessModel):
        return {}
    found = by_case.get(str(number), [])
    measured = [row.marker for row in published_markers(number) if row.experiment]
    if len(found) != len(measured):
        return None
    return dict(zip(measured, map(float, found), strict=True))
