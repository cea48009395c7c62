"""One run of the closed loop: machine, true cable, tracker and controller in one process."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import WantedLay
from lay_control_node.control.lay_controller import Setpoint
from winding_core.commands import CARRIAGE, AxisTarget, JointTargets, TensionCommand
from winding_core.condition import ResolvedCondition
from winding_core.lay_control_records import ControlMode
from winding_core.readings import AxisReading
from winding_rig_node.lay.lay_on import HiddenRig
from winding_rig_node.machine.commander import CommandLimits
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import MachineConfig
from winding_verification.closed_loop.camera import CameraErrors, SimulatedTracker
from winding_verification.closed_loop.truths import DrivenTruth, RodTruth, Truth

Array = NDArray[np.float64]

SAMPLE = 1.0e-3
# Samples between commands, frames and lays.
_COMMANDS, _FRAMES, _LAYS = 20, 5, 100
_FULL_TURN = 2.0 * math.pi


@dataclass(frozen=True, kw_only=True)
class ClosedRun:
    """What is run.

    Attributes:
        what: Condition.
        wanted: Lay that is wanted.
        markers: Wound angle at which a marker is wanted [rad], by marker.
        end: Wound angle at which the run ends [rad].
        truth: One of TRUTHS.
        hidden: The rig.
        control: How the lay is controlled.
        mode: DRIVE, or WATCH for the open loop.
        sees_lay: Whether the tracker measures every turn, or markers alone.
        errors: Of the tracker.
        seed: Of the errors.
        tracker_until: Time after which the tracker is dead [s].
    """

    what: ResolvedCondition
    wanted: WantedLay
    markers: Mapping[int, float] = field(default_factory=dict)
    end: float
    truth: str
    hidden: HiddenRig
    control: ControlParameters = field(default_factory=ControlParameters)
    mode: ControlMode = ControlMode.DRIVE
    sees_lay: bool = True
    errors: CameraErrors = field(default_factory=CameraErrors)
    seed: int = 0
    tracker_until: float = math.inf


@dataclass(frozen=True, kw_only=True)
class ClosedResult:
    """Where the cable landed.

    Attributes:
        marker_theta: Wound angles of P1 and on [rad], shape (m,); nan for one that never landed.
        marker_error: z less the wanted z there [m], shape (m,).
        theta: Wound angles [rad], shape (n,).
        z: Where the cable lies there [m].
        error: z less the wanted z there [m], shape (n,).
        setpoints: What was commanded, or would have been.
        carriage: Carriage position at each setpoint [m].
    """

    marker_theta: Array
    marker_error: Array
    theta: Array
    z: Array
    error: Array
    setpoints: tuple[Setpoint, ...]
    carriage: Array

    def turn_rms(self) -> Array:
        """Return the root mean square of the error of each complete turn [m]."""
        turns = (self.theta / _FULL_TURN).astype(int)
        whole = range(int(self.theta[-1] / _FULL_TURN))
        return np.array([math.sqrt(np.mean(self.error[turns == n] ** 2)) for n in whole])


def truth_of(run: ClosedRun) -> Truth:
    """Return the cable of a run."""
    if run.truth == "rod":
        return RodTruth(run.what.case, run.hidden, run.what.friction)
    return DrivenTruth(run.what.case, run.hidden)


def wind(run: ClosedRun) -> ClosedResult:
    """Wind a run until its end."""
    rng = np.random.default_rng((run.seed, 77))
    what, case = run.what, run.what.case
    truth = truth_of(run)
    tracker = SimulatedTracker(truth, run.errors, rng)
    limits = CommandLimits()
    limits = replace(
        limits,
        low_tension=min(limits.low_tension, 0.3 * case.weight),
        high_tension=max(limits.high_tension, 1.5 * case.weight),
    )
    drive = what.drive
    duration = 2.0 * drive.time_at_angle(run.end)
    machine = Machine(
        MachineConfig(case=case, drive=drive, duration=duration, commands=limits), rng
    )
    controller = run.control.controller(what, run.wanted, markers=run.markers, mode=run.mode)
    setpoints: list[Setpoint] = []
    carriage: list[float] = []
    machine.start()
    sample = 0
    while machine.reading().cylinder_angle < run.end and machine.moving:
        machine.step()
        sample += 1
        state = machine.state
        reading = machine.reading()
        truth.advance(
            machine.time,
            AxisReading(
                cylinder_angle=state.cylinder.motor.position,
                angular_speed=state.cylinder.motor.speed,
                carriage_position=state.carriage.motor.position,
                feed_speed=state.carriage.motor.speed,
            ),
            machine.pull,
        )
        seen = machine.time <= run.tracker_until
        if seen and sample % _FRAMES == 0:
            controller.take_markers(tracker.markers(reading.cylinder_angle))
        if seen and run.sees_lay and sample % _LAYS == 0:
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
    at = truth.marker_theta()
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
    )


def _command(machine: Machine, setpoint: Setpoint) -> None:
    target = AxisTarget(position=setpoint.guide, speed=setpoint.guide_speed)
    machine.command(JointTargets(t=setpoint.t, axes={CARRIAGE: target}))
    if setpoint.pull is not None:
        machine.command(TensionCommand(t=setpoint.t, force=setpoint.pull))
