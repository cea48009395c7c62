"""One run of the closed loop: machine, true cable, tracker and controller in one process.

The true cable is the rig's own lay or the explicit rod; what the tracker measures of it has the
errors that were measured of the real one.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import WantedLay
from lay_control_node.control.lay_controller import Setpoint
from lay_control_node.control.layer_watch import LayerFault
from winding_core.cable.cases import Case
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.layers import WoundDrum
from winding_core.lay.records import LAY_DTYPE, ControlMode, LayRecords
from winding_core.machine.commands import CARRIAGE, AxisTarget, JointTargets, TensionCommand
from winding_core.machine.readings import AxisReading
from winding_core.machine.tension import RigTension
from winding_core.markers import MARKER_DTYPE, Markers
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_law import LayTruth
from winding_rig_node.lay.lay_on import HiddenRig
from winding_rig_node.machine.commander import CommandLimits
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import MachineConfig, cylinder_axis

Array = NDArray[np.float64]

# Samples between commands, frames and lays.
_COMMANDS, _FRAMES, _LAYS = 20, 5, 100
_FULL_TURN = 2.0 * math.pi
# A place is seen from here behind the contact line on, and a marker for this long [rad].
_SEEN_FROM = 0.15
_MARKER_SEEN = (0.05, 1.2)
_PLACE = math.radians(5.0)
_PLACES = 864

_ROD_STRIDE = 10  # Samples of the machine between two advances of the rod


class RodTruth:
    """The explicit rod with contact and friction behind the hidden rig of a `DrivenLay`.

    Its law of the lag is its own: bending, inertia and slip are those of the finite elements.

    Args:
        case: What is wound.
        hidden: What the rig does to it; its bending is the rod's own.
        friction: Of cable on cylinder.
    """

    def __init__(self, case: Case, hidden: HiddenRig, friction: float) -> None:
        self._hidden, self._radius = hidden, case.centreline_radius
        self._rod = RodWinding(
            WindingConfig(
                case=case, friction=friction, law="neo_hookean", free_length=hidden.free_length
            )
        )
        self._build_up = RigTension(
            start_share=hidden.start_share, build_up_length=hidden.build_up_length
        )
        self._spacing = case.marker_spacing * np.arange(case.marker_count + 1)
        self._diameter = case.cylinder_diameter
        self._eye = 0.0
        self._held = case.weight
        self._samples = 0
        self._path: tuple[Array, Array, Array] | None = None

    def advance(self, t: float, reading: AxisReading, pull: float) -> None:
        """Go on to a time [s], the axes as they truly stand, under a pull at the guide [N]."""
        hidden = self._hidden
        play = 0.5 * hidden.guide_play
        carriage = reading.carriage_position
        self._eye = min(max(self._eye, carriage - play), carriage + play)
        band = hidden.brake_friction * pull
        self._held = min(max(self._held, pull - band), pull + band)
        self._samples += 1
        if self._samples % _ROD_STRIDE:
            return
        final = hidden.load_share * self._held + hidden.drag
        wound = self._radius * max(reading.cylinder_angle, 0.0)
        moving = self._eye in (carriage - play, carriage + play)
        self._rod.advance_to(
            t,
            AxisReading(
                cylinder_angle=reading.cylinder_angle,
                angular_speed=reading.angular_speed,
                carriage_position=self._eye,
                feed_speed=reading.feed_speed if moving else 0.0,
            ),
            self._build_up(final, self._diameter, wound),
        )
        self._path = None

    def z_at(self, theta: ArrayLike) -> Array:
        """Return where the cable lies [m] at wound angles [rad], same shape."""
        _, wound, z = self._wound()
        return np.asarray(np.interp(np.asarray(theta, dtype=float), wound, z, right=np.nan))

    @property
    def marker_theta(self) -> Array:
        """Wound angles of P0 to the last marker [rad]; nan for one that has not landed."""
        arc, wound, _ = self._wound()
        return np.asarray(np.interp(self._spacing, arc, wound, right=np.nan))

    def _wound(self) -> tuple[Array, Array, Array]:
        if self._path is None:
            self._path = self._rod.wound_path()
        return self._path


@dataclass(frozen=True, kw_only=True)
class CameraErrors:
    """Standard deviations of what the tracker measures (docs/vision.md)."""

    frame_theta: float = 3.0e-3  # Of a marker's angle in one frame [rad]
    frame_z: float = 1.2e-4  # Of its height in one frame [m]
    marker_theta: float = 1.0e-3  # What all frames of a marker have in common [rad]
    marker_z: float = 3.0e-5  # The same of its height [m]
    lay_z: float = 3.0e-5  # Of a place of the cable [m], anew for each place
    common_z: float = 3.0e-5  # What all places of a run have in common [m]


@dataclass(eq=False)
class SimulatedTracker:
    """Sees a lay with errors drawn at random, the same ones each time it looks at a place."""

    truth: DrivenLay | RodTruth  # The cable
    errors: CameraErrors  # How wrong it is
    rng: np.random.Generator  # Of the errors
    highest: float = math.inf  # How far above the bare cylinder it still sees cable [m]

    def __post_init__(self) -> None:
        self._common = self.errors.common_z * self.rng.standard_normal()
        self._of_markers: dict[int, tuple[float, float]] = {}
        self._of_places = self.errors.lay_z * self.rng.standard_normal(_PLACES)

    def markers(self, theta: float) -> Markers:
        """Return the records of one frame with the cylinder at a wound angle [rad]."""
        errors, rng = self.errors, self.rng
        near, far = _MARKER_SEEN
        at = self.truth.marker_theta[1:]
        seen = [n for n in range(at.size) if near < theta - at[n] < far]
        records = np.zeros(len(seen), dtype=MARKER_DTYPE)
        for record, n in zip(records, seen, strict=True):
            if n not in self._of_markers:
                own = rng.standard_normal(2)
                self._of_markers[n] = (errors.marker_theta * own[0], errors.marker_z * own[1])
            angle, height = self._of_markers[n]
            frame = rng.standard_normal(2)
            record["id"] = n + 1
            record["theta"] = at[n] + angle + errors.frame_theta * frame[0]
            record["z"] = (
                float(self.truth.z_at(at[n])) + self._common + height + errors.frame_z * frame[1]
            )
            record["sigma_theta"], record["sigma_z"] = errors.frame_theta, errors.frame_z
        return records

    def lay(self, theta: float) -> LayRecords:
        """Return the places of the newest twelve turns with the cylinder at a wound angle [rad]."""
        last = int((theta - _SEEN_FROM) / _PLACE)
        numbers = np.arange(max(1, last - _PLACES + 1), last + 1)
        records = np.zeros(numbers.size, dtype=LAY_DTYPE)
        records["theta"] = numbers * _PLACE
        own = self._of_places[numbers % _PLACES]
        records["z"] = self.truth.z_at(records["theta"]) + self._common + own
        records["sigma_z"] = self.errors.lay_z
        if isinstance(self.truth, DrivenLay):
            laid = self.truth.truth(self.truth.wound_angle)
            if laid.radius.size:
                on_bare = self.truth.case.centreline_radius
                records["lift"] = np.interp(records["theta"], laid.theta, laid.radius) - on_bare
        known = np.isfinite(records["z"]) & (records["lift"] <= self.highest)
        seen: LayRecords = records[known]
        return seen


@dataclass(frozen=True, kw_only=True)
class ClosedRun:
    """What is run."""

    what: ResolvedCondition  # Condition
    wanted: WantedLay  # Lay that is wanted
    # Wound angle at which a marker is wanted [rad], by marker.
    markers: Mapping[int, float] = field(default_factory=dict)
    end: float  # Wound angle at which the run ends [rad]
    truth: str  # rod, or driven: which cable is the true one
    hidden: HiddenRig  # The rig
    # How the lay is controlled.
    control: ControlParameters = field(default_factory=ControlParameters)
    mode: ControlMode = ControlMode.DRIVE  # DRIVE, or WATCH for the open loop
    errors: CameraErrors = field(default_factory=CameraErrors)  # Of the tracker
    seed: int = 0  # Of the errors
    drum: WoundDrum | None = None  # As it is to be filled; None for a bare cylinder
    highest_seen: float = math.inf  # How far above the bare cylinder the tracker sees cable [m]
    # By how much the eye stands beside its place on the carriage at a cylinder angle [rad] -> [m].
    displaced: Callable[[float], float] = field(default=lambda _: 0.0)


@dataclass(frozen=True, kw_only=True)
class ClosedResult:
    """Where the cable landed."""

    # Wound angles of P1 and on [rad], shape (m,); nan for one that never landed.
    marker_theta: Array
    marker_error: Array  # z less the wanted z there [m], shape (m,)
    theta: Array  # Wound angles [rad], shape (n,)
    z: Array  # Where the cable lies there [m]
    error: Array  # z less the wanted z there [m], shape (n,)
    setpoints: tuple[Setpoint, ...]  # What was commanded, or would have been
    carriage: Array  # Carriage position at each setpoint [m]
    lay: LayTruth | None = None  # Of the driven cable
    faults: tuple[LayerFault, ...] = ()  # That the controller found

    def turn_rms(self) -> Array:
        """Return the root mean square of the error of each complete turn [m]."""
        turns = (self.theta / _FULL_TURN).astype(int)
        whole = range(int(self.theta[-1] / _FULL_TURN))
        return np.array([math.sqrt(np.mean(self.error[turns == n] ** 2)) for n in whole])


def wind(run: ClosedRun) -> ClosedResult:
    """Wind a run until its end."""
    rng = np.random.default_rng((run.seed, 77))
    what, case = run.what, run.what.case
    truth = (
        RodTruth(case, run.hidden, what.friction)
        if run.truth == "rod"
        else DrivenLay(case, run.hidden, run.drum.drum if run.drum else None)
    )
    tracker = SimulatedTracker(truth, run.errors, rng, run.highest_seen)
    limits = CommandLimits()
    limits = replace(
        limits,
        low_tension=min(limits.low_tension, 0.3 * case.weight),
        high_tension=max(limits.high_tension, 1.5 * case.weight),
    )
    drive = what.drive
    duration = 2.0 * drive.time_at_angle(run.end)
    machine = Machine(
        MachineConfig(
            case=case, drive=drive, duration=duration, cylinder=cylinder_axis(case), commands=limits
        ),
        rng,
    )
    controller = run.control.controller(
        what, run.wanted, markers=run.markers, mode=run.mode, wound=run.drum
    )
    setpoints: list[Setpoint] = []
    carriage: list[float] = []
    machine.start()
    sample = 0
    while machine.reading().cylinder_angle < run.end and machine.moving:
        machine.step()
        sample += 1
        reading = machine.reading()
        true = machine.true_reading()
        eye = true.carriage_position + run.displaced(true.cylinder_angle)
        if isinstance(truth, DrivenLay):
            truth.advance(true.cylinder_angle, eye, machine.pull)
        else:
            truth.advance(machine.time, replace(true, carriage_position=eye), machine.pull)
        if sample % _FRAMES == 0:
            controller.take_markers(tracker.markers(reading.cylinder_angle))
        if sample % _LAYS == 0:
            controller.take_lay(tracker.lay(reading.cylinder_angle))
        if sample % _COMMANDS == 0:
            pull = machine.state.tension
            setpoint = controller.advance(
                machine.time, reading, case.weight if pull is None else pull
            )
            setpoints.append(setpoint)
            carriage.append(reading.carriage_position)
            if run.mode is ControlMode.DRIVE:
                _command(machine, setpoint)
    at = truth.marker_theta[1:].copy()
    theta = np.arange(0.0, run.end, 0.02)
    z = truth.z_at(theta)
    known = np.isfinite(z)
    theta, z = theta[known], z[known]
    wanted = np.array([run.wanted.at(float(angle)).z for angle in theta])
    landed = np.array([run.wanted.at(float(angle)).z for angle in np.nan_to_num(at)])
    return ClosedResult(
        marker_theta=at,
        marker_error=np.where(np.isfinite(at), truth.z_at(np.nan_to_num(at)) - landed, np.nan),
        theta=theta,
        z=z,
        error=z - wanted,
        setpoints=tuple(setpoints),
        carriage=np.array(carriage),
        lay=truth.truth(truth.wound_angle) if isinstance(truth, DrivenLay) else None,
        faults=tuple(controller.watch.faults) if controller.watch else (),
    )


def _command(machine: Machine, setpoint: Setpoint) -> None:
    target = AxisTarget(position=setpoint.guide, speed=setpoint.guide_speed)
    machine.command(JointTargets(t=setpoint.t, axes={CARRIAGE: target}))
    if setpoint.pull is not None:
        machine.command(TensionCommand(t=setpoint.t, force=setpoint.pull))
