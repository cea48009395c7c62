"""The winding machine: two controlled axes, load cell, run phases; advanced by samples."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from cable_winding.cases import Case
from cable_winding.drive import DriveProfile
from cable_winding.readings import AxisReading
from winding_rig_node.axis import AxisConfig, AxisState, advance_axis, control_axis, tuned_pid
from winding_rig_node.encoder import CARRIAGE_ENCODER, CYLINDER_ENCODER
from winding_rig_node.motor import CARRIAGE_MOTOR, CYLINDER_MOTOR

SAMPLE_RATE = 1000
CONTROL_RATE = 500
_SAMPLE_PERIOD = 1.0 / SAMPLE_RATE
_SAMPLES_PER_CONTROL = SAMPLE_RATE // CONTROL_RATE
_GRAVITY = 9.80665
_LOOP_BANDWIDTH = 4.0

CYLINDER_AXIS = AxisConfig(
    motor=CYLINDER_MOTOR,
    encoder=CYLINDER_ENCODER,
    pid=tuned_pid(CYLINDER_MOTOR, _LOOP_BANDWIDTH),
)
CARRIAGE_AXIS = AxisConfig(
    motor=CARRIAGE_MOTOR,
    encoder=CARRIAGE_ENCODER,
    pid=tuned_pid(CARRIAGE_MOTOR, _LOOP_BANDWIDTH),
)


class Phase(Enum):
    """What the machine is doing."""

    IDLE = "idle"
    WINDING = "winding"
    STOPPING = "stopping"
    FINISHED = "finished"
    EMERGENCY = "emergency stop"


@dataclass(frozen=True, kw_only=True)
class MachineConfig:
    """The machine and its load.

    Attributes:
        case: What is wound.
        drive: Target speeds.
        duration: Drive time after which a run is finished [s].
        cylinder: Rotating axis.
        carriage: Traversing axis.
        force_noise: One standard deviation of the load cell [N].
        force_resolution: Step of its converter [N].
    """

    case: Case
    drive: DriveProfile
    duration: float
    cylinder: AxisConfig = CYLINDER_AXIS
    carriage: AxisConfig = CARRIAGE_AXIS
    force_noise: float = 0.01
    force_resolution: float = 0.001


@dataclass(kw_only=True)
class MachineState:
    """Everything that changes.

    Attributes:
        sample: Number of encoder samples since the machine was switched on.
        drive_sample: Samples of the current run, the ramps of stops and starts included.
        fraction: Share of full speed that the setpoints ask for.
        fraction_rate: Its change per second [1/s].
        full_speed_time: Time at full speed that covers the commanded way so far [s].
    """

    phase: Phase = Phase.IDLE
    sample: int = 0
    drive_sample: int = 0
    fraction: float = 0.0
    fraction_rate: float = 0.0
    full_speed_time: float = 0.0
    cylinder: AxisState = field(default_factory=AxisState)
    carriage: AxisState = field(default_factory=AxisState)


class PhaseError(ValueError):
    """The machine cannot do this in its present phase."""


class Machine:
    """Simulated rig: `step` moves it by one encoder sample (1 ms)."""

    def __init__(self, config: MachineConfig, rng: np.random.Generator) -> None:
        self.config = config
        self.state = MachineState()
        self._rng = rng

    @property
    def time(self) -> float:
        """Simulated time since the machine was switched on [s]."""
        return self.state.sample / SAMPLE_RATE

    @property
    def moving(self) -> bool:
        """Whether simulated time has work to do."""
        if self.state.phase is Phase.EMERGENCY:
            return self._turns()
        return self.state.phase in (Phase.WINDING, Phase.STOPPING)

    def start(self) -> None:
        """Begin or resume winding; a machine that winds goes on."""
        if self.state.phase not in (Phase.IDLE, Phase.STOPPING, Phase.WINDING):
            raise PhaseError(f"cannot start while the machine is in {self.state.phase.value}")
        self.state.phase = Phase.WINDING

    def stop(self) -> None:
        """Ramp both axes down together and hold."""
        if self.state.phase is not Phase.WINDING:
            raise PhaseError(f"cannot stop while the machine is in {self.state.phase.value}")
        self.state.phase = Phase.STOPPING

    def emergency_stop(self) -> None:
        """Cut the drives and apply the brakes."""
        self.state.phase = Phase.EMERGENCY
        self.state.fraction = self.state.fraction_rate = 0.0

    def reset(self) -> None:
        """Go back to the start of a run; simulated time goes on."""
        if self.state.phase is Phase.WINDING or self._turns():
            raise PhaseError("cannot reset while the machine moves; stop it first")
        self.state = MachineState(sample=self.state.sample)

    def step(self) -> None:
        """Advance by one encoder sample; every second one is a control step."""
        state, config = self.state, self.config
        if not self.moving:
            return
        if state.drive_sample % _SAMPLES_PER_CONTROL == 0:
            self._control()
        braked = state.phase is Phase.EMERGENCY
        load = config.case.weight * config.case.centreline_radius
        advance_axis(config.cylinder, state.cylinder, load=load, dt=_SAMPLE_PERIOD, braked=braked)
        advance_axis(config.carriage, state.carriage, load=0.0, dt=_SAMPLE_PERIOD, braked=braked)
        state.sample += 1
        state.drive_sample += 1
        state.full_speed_time += _SAMPLE_PERIOD * state.fraction
        if state.phase is Phase.STOPPING and state.fraction == 0.0 and not self._turns():
            state.phase = Phase.IDLE
        elif state.phase is Phase.WINDING and state.drive_sample >= round(
            config.duration * SAMPLE_RATE
        ):
            state.phase = Phase.FINISHED

    def reading(self) -> AxisReading:
        """Return what the encoders say now."""
        cylinder, carriage = self.state.cylinder.encoder, self.state.carriage.encoder
        return AxisReading(
            cylinder_angle=cylinder.position,
            angular_speed=cylinder.speed,
            carriage_position=carriage.position,
            feed_speed=carriage.speed,
        )

    def setpoints(self) -> AxisReading:
        """Return what the controllers are asked for now."""
        drive, share = self.config.drive, self.state.fraction
        return AxisReading(
            cylinder_angle=drive.angular_speed * self.state.full_speed_time,
            angular_speed=drive.angular_speed * share,
            carriage_position=drive.feed_speed * self.state.full_speed_time,
            feed_speed=drive.feed_speed * share,
        )

    def tension(self) -> float:
        """Return one load cell sample [N]: the weight, its acceleration, noise and steps."""
        angular = self.config.drive.angular_speed * self.state.fraction_rate
        acceleration = angular * self.config.case.centreline_radius
        force = self.config.case.weight * (1.0 + acceleration / _GRAVITY)
        noisy = force + self.config.force_noise * self._rng.standard_normal()
        step = self.config.force_resolution
        return step * round(noisy / step)

    def _turns(self) -> bool:
        return self.state.cylinder.motor.speed != 0.0 or self.state.carriage.motor.speed != 0.0

    def _control(self) -> None:
        state, drive = self.state, self.config.drive
        period = _SAMPLES_PER_CONTROL * _SAMPLE_PERIOD
        target = 1.0 if state.phase is Phase.WINDING else 0.0
        change = period / drive.ramp_time
        before = state.fraction
        state.fraction = before + min(max(target - before, -change), change)
        state.fraction_rate = (state.fraction - before) / period
        for axis_config, axis, full in (
            (self.config.cylinder, state.cylinder, drive.angular_speed),
            (self.config.carriage, state.carriage, drive.feed_speed),
        ):
            control_axis(
                axis_config,
                axis,
                setpoint=full * state.fraction,
                acceleration=full * state.fraction_rate,
                dt=period,
            )
