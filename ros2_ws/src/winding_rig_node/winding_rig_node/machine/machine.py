"""The winding machine: two controlled axes, load cell, run phases; advanced by samples."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from winding_core.machine.commands import AXES, CARRIAGE, Command
from winding_core.machine.readings import CABLE_TENSION, AxisReading, GuidePlace
from winding_rig_node.machine.arm_guide import ArmGuide, ArmState
from winding_rig_node.machine.axis import (
    AxisConfig,
    AxisState,
    EncoderState,
    MotorState,
    advance_axis,
    control_axis,
    modelled_speed,
)
from winding_rig_node.machine.commander import Commander, CommandError
from winding_rig_node.machine.faults import Faults
from winding_rig_node.machine.machine_config import (
    CARRIAGE_ENCODER_SIGNAL,
    CONTROL_RATE,
    CYLINDER_ENCODER_SIGNAL,
    FORCE_RATE,
    LOAD_CELL_SIGNAL,
    SAMPLE_RATE,
    MachineConfig,
    MachineState,
    Phase,
    PhaseError,
    sensor_limits,
)
from winding_rig_node.machine.plausibility import AxisObservation, Plausibility
from winding_rig_node.machine.setpoints import Setpoints

_SAMPLE_PERIOD = 1.0 / SAMPLE_RATE
_SAMPLES_PER_CONTROL = SAMPLE_RATE // CONTROL_RATE
_SAMPLES_PER_FORCE = SAMPLE_RATE // FORCE_RATE
_GRAVITY = 9.80665


class Machine:
    """Simulated rig: `step` moves it by one encoder sample (1 ms).

    The machine judges its own sensors: what cannot be is refused, and what lasts ends in a
    protective stop that only `reset` releases.
    """

    def __init__(self, config: MachineConfig, rng: np.random.Generator) -> None:
        self.config = config
        self.state = self._at_start()
        self.faults = Faults()  # What is wrong with its sensors on purpose
        self.plausibility = Plausibility(sensor_limits(config))  # Judge of its sensors
        # What outside commanders have asked for since the last start.
        self.commander = Commander(config.commands)
        # Last reading of each sensor beside the encoders, by the name of its quantity; None when it
        # was invalid.
        self.sensors: Mapping[str, Callable[[], float | None]] = {
            CABLE_TENSION.name: lambda: self.state.tension,
        }
        self._rng = rng

    @property
    def time(self) -> float:
        """Simulated time since the machine was switched on [s]."""
        return self.state.time

    @property
    def pull(self) -> float:
        """Pull on the cable at the guide [N]: the weight and its acceleration, or the brake's."""
        if self.commander.brake is not None:
            return self.commander.brake.pull
        angular = self.config.drive.angular_speed * self.state.fraction_rate
        acceleration = angular * self.config.case.centreline_radius
        return self.config.case.weight * (1.0 + acceleration / _GRAVITY)

    @property
    def moving(self) -> bool:
        """Whether simulated time has work to do."""
        if self.state.phase is Phase.EMERGENCY:
            return self._turns()
        if self.state.phase is Phase.PROTECTIVE:
            return not self._settled()
        return self.state.phase in (Phase.WINDING, Phase.STOPPING)

    def start(self) -> None:
        """Begin or resume winding; a machine that winds goes on.

        Raises:
            PhaseError: It neither stands at a start, winds nor ramps down, or an axis that was
                commanded is still coming to rest.
        """
        if self.state.phase not in (Phase.IDLE, Phase.STOPPING, Phase.WINDING):
            raise PhaseError(f"cannot start while the machine is in {self.state.phase.value}")
        if self.state.phase is not Phase.WINDING:
            self._setpoints.take_back()
            self.plausibility.config = sensor_limits(self.config)
        if self.state.phase is Phase.IDLE:
            self.plausibility.begin(self.time)
        if self.state.drive_sample == 0:
            self.state.tension = self.tension()
        self.state.phase = Phase.WINDING
        self.state.quick = False
        self.state.reason = ""

    def stop(self) -> None:
        """Ramp both axes down together and hold.

        Raises:
            PhaseError: It does not wind.
        """
        if self.state.phase is not Phase.WINDING:
            raise PhaseError(f"cannot stop while the machine is in {self.state.phase.value}")
        self.state.phase, self.state.stopped = Phase.STOPPING, True

    def quick_stop(self, reason: str = "") -> None:
        """Bring both axes to rest soon and hold them with the brakes; `start` resumes.

        A machine that does not wind stands already, or is on its way.
        """
        if self.state.phase in (Phase.WINDING, Phase.STOPPING) and not self.hurried:
            self._hurry(Phase.STOPPING, reason)

    def protect(self, reason: str) -> None:
        """Bring both axes to rest without trust in the encoders; only `reset` releases them."""
        if self.state.phase not in (Phase.EMERGENCY, Phase.PROTECTIVE):
            self._hurry(Phase.PROTECTIVE, reason)

    def command(self, command: Command) -> None:
        """Execute an external command; its axes leave the drive programme until a start.

        Raises:
            CommandError: The machine does not wind, or cannot do that; nothing has changed.
        """
        try:
            if self.state.phase is not Phase.WINDING:
                raise CommandError(
                    f"commands are taken while the machine winds, it is in {self.state.phase.value}"
                )
            standing = self._setpoints.as_taken_over()
            self.commander.take(command, self.time, standing, self._resting_pull())
        except CommandError as error:
            self.commander.refuse(str(error))
            raise
        self.plausibility.config = sensor_limits(self.config, self._setpoints.full_speeds())

    def emergency_stop(self) -> None:
        """Cut the drives and apply the brakes."""
        self._hurry(Phase.EMERGENCY, self.state.reason)
        self.state.fraction = self.state.fraction_rate = 0.0
        self.commander.halt()

    def reset(self) -> None:
        """Go back to the start of a run; simulated time goes on.

        Raises:
            PhaseError: It moves.
        """
        # Time ends with a finished run, so its last speeds would never come to rest.
        finished = self.state.phase is Phase.FINISHED
        if self.state.phase is Phase.WINDING or (self._turns() and not finished):
            raise PhaseError("cannot reset while the machine moves; stop it first")
        self.state = self._at_start(self.state.sample)
        self.commander = Commander(self.config.commands)
        self.plausibility.config = sensor_limits(self.config)
        self.plausibility.forget()

    def step(self) -> None:
        """Advance by one encoder sample; every second one is a control step."""
        state = self.state
        if not self.moving:
            return
        if state.drive_sample % _SAMPLES_PER_CONTROL == 0:
            self._control()
        asked_to_stand = state.fraction == 0.0 and self.commander.standing
        braked = state.phase is Phase.EMERGENCY or (self.hurried and asked_to_stand)
        state.sample += 1
        for index, (axis_config, axis, load, _) in enumerate(self._axes()):
            seen = partial(self._seen, index)
            if index and self._arm is not None:
                arm, joints = self._arm
                arm.advance(joints, axis, dt=_SAMPLE_PERIOD, braked=braked, seen=seen)
                continue
            advance_axis(axis_config, axis, load=load, dt=_SAMPLE_PERIOD, braked=braked, seen=seen)
        state.drive_sample += 1
        state.full_speed_time += _SAMPLE_PERIOD * state.fraction
        if self.hurried and state.stood_at is None and not self._turns():
            state.stood_at = self.time
        if state.phase is Phase.STOPPING and asked_to_stand and self._settled():
            state.phase = Phase.IDLE
        elif state.phase is Phase.WINDING and self._at_end():
            state.phase = Phase.FINISHED
        if state.drive_sample % _SAMPLES_PER_FORCE == 0:
            state.tension = self.tension()
        if state.drive_sample % _SAMPLES_PER_CONTROL == 0:
            self._judge()

    def reading(self) -> AxisReading:
        """Return the encoders' readings now."""
        guide = None if self.state.arm is None else self.state.arm.place
        return _axes(self.state.cylinder.encoder, self.state.carriage.encoder, guide)

    def true_reading(self) -> AxisReading:
        """Return where both axes truly stand now, and how fast they move."""
        guide = None if self.state.arm is None else self.state.arm.true_place
        return _axes(self.state.cylinder.motor, self.state.carriage.motor, guide)

    @property
    def arm_joints(self) -> tuple[tuple[str, ...], tuple[float, ...]]:
        """Names and measured positions [rad or m] of the arm's joints; none without an arm."""
        if self._arm is None:
            return (), ()
        arm, joints = self._arm
        return arm.names, tuple(arm.measured(joints).tolist())

    @property
    def remark(self) -> str:
        """Why the guide is slower than it was asked to be; else empty."""
        return "" if self.state.arm is None else self.state.arm.remark

    def setpoints(self) -> AxisReading:
        """Return what the controllers are asked for now."""
        (angle, angular_speed), (way, feed_speed) = map(self._setpoints.now, AXES)
        return AxisReading(
            cylinder_angle=angle,
            angular_speed=angular_speed,
            carriage_position=way,
            feed_speed=feed_speed,
        )

    def tension(self) -> float | None:
        """Return one load cell sample [N], or None when it is invalid.

        It is the pull on the cable with noise and the converter's steps.
        """
        force = self.pull
        if self.commander.brake is not None:
            self.plausibility.config = replace(self.plausibility.config, weight=force)
        noisy = force + self.config.force_noise * self._rng.standard_normal()
        step = self.config.force_resolution
        reading = self.faults.through(LOAD_CELL_SIGNAL, self.time, step * round(noisy / step))
        return self.plausibility.tension(self.time, reading)

    def _at_start(self, sample: int = 0) -> MachineState:
        arm = self.config.arm
        return MachineState(sample=sample, arm=None if arm is None else arm.at_start())

    @property
    def _arm(self) -> tuple[ArmGuide, ArmState] | None:
        if self.config.arm is None or self.state.arm is None:
            return None
        return self.config.arm, self.state.arm

    def _turns(self) -> bool:
        return self.state.cylinder.motor.speed != 0.0 or self.state.carriage.motor.speed != 0.0

    @property
    def hurried(self) -> bool:
        """Whether the machine is on its way to a standstill that nothing may delay."""
        return self.state.phase in (Phase.EMERGENCY, Phase.PROTECTIVE) or (
            self.state.phase is Phase.STOPPING and self.state.quick
        )

    def _hurry(self, phase: Phase, reason: str) -> None:
        state = self.state
        if not self.hurried:
            state.stop_began, state.stood_at = self.time, None
        state.phase, state.reason, state.stopped = phase, reason, True
        state.quick = phase is Phase.STOPPING

    def _at_end(self) -> bool:
        """Return whether the drive programme has been wound, over all stops in it."""
        state, config = self.state, self.config
        if state.drive_sample < round(config.duration * SAMPLE_RATE):
            return False
        # Ramps of a stop and of the start after it take longer than what they wind.
        whole = float(config.drive.full_speed_time(config.duration))
        return not state.stopped or state.full_speed_time >= whole - _SAMPLE_PERIOD

    def _settled(self) -> bool:
        """Return whether both axes stand, and have for long enough after an unplanned stop."""
        if self._turns() or not self.hurried:
            return not self._turns()
        stood = self.state.stood_at
        return stood is not None and self.time - stood >= self.config.settling_time

    def _axes(self) -> tuple[tuple[AxisConfig, AxisState, float, str], ...]:
        load = self._resting_pull() * self.config.case.centreline_radius
        return (
            (self.config.cylinder, self.state.cylinder, load, CYLINDER_ENCODER_SIGNAL),
            (self.config.carriage, self.state.carriage, 0.0, CARRIAGE_ENCODER_SIGNAL),
        )

    def _resting_pull(self) -> float:
        brake = self.commander.brake
        return self.config.case.weight if brake is None else brake.pull

    @property
    def _setpoints(self) -> Setpoints:
        return Setpoints(self.config, self.state, self.commander)

    def _seen(self, index: int, position: float) -> float | None:
        """Return what an axis's encoder makes of its position, if that can be."""
        reading = self.faults.through(self._axes()[index][3], self.time, position)
        return self.plausibility.position(index, self.time, reading)

    def _control(self) -> None:
        state = self.state
        period = _SAMPLES_PER_CONTROL * _SAMPLE_PERIOD
        target = 1.0 if state.phase is Phase.WINDING else 0.0
        change = period / (
            self.config.quick_stop_time if self.hurried else self.config.drive.ramp_time
        )
        before = state.fraction
        state.fraction = before + min(max(target - before, -change), change)
        state.fraction_rate = (state.fraction - before) / period
        if self.commander.brake is not None:
            self.commander.brake.advance(self.config.commands.brake_time, period)
        for (axis_config, axis, load, _), name in zip(self._axes(), AXES, strict=True):
            setpoint, acceleration = self._setpoints.advance(
                name, axis.encoder.position, period, hurried=self.hurried
            )
            open_loop = state.phase is Phase.PROTECTIVE
            if name == CARRIAGE and self._arm is not None:
                arm, joints = self._arm
                arm.control(
                    joints,
                    axis,
                    setpoint=setpoint,
                    acceleration=acceleration,
                    dt=period,
                    open_loop=open_loop,
                )
                continue
            control_axis(
                axis_config,
                axis,
                setpoint=setpoint,
                acceleration=acceleration,
                dt=period,
                load=load,
                open_loop=open_loop,
            )

    def _judge(self) -> None:
        """Stop the machine when its sensors have not fitted it for too long."""
        if self.state.phase not in (Phase.WINDING, Phase.STOPPING):
            return
        if self.state.phase is Phase.WINDING and (cause := self.commander.verdict(self.time)):
            self.stop()
            self.state.reason = cause
        reason = self.plausibility.verdict(
            self.time,
            tuple(
                AxisObservation(
                    commanded=axis.setpoint,
                    measured=axis.encoder.speed,
                    modelled=(
                        modelled_speed(config, axis, load=load)
                        if self._arm is None or signal != CARRIAGE_ENCODER_SIGNAL
                        else self._arm[0].modelled_speed(self._arm[1])
                    ),
                )
                for config, axis, load, signal in self._axes()
            ),
        )
        if reason is not None:
            self.protect(reason)


def axis_trial(config: MachineConfig, seed: int = 0) -> NDArray[np.float64]:
    """Drive both axes through a run.

    Returns:
        A row for each sample, shape (n, 9): time [s], then angle, speed, carriage position and
        carriage speed as `AxisReading` has them, measured and then commanded.
    """
    machine = Machine(config, np.random.default_rng(seed))
    machine.start()
    rows = []
    for _ in range(round(config.duration * SAMPLE_RATE)):
        machine.step()
        rows.append((machine.time, *machine.reading().numbers, *machine.setpoints().numbers))
    return np.array(rows)


def _axes(
    cylinder: EncoderState | MotorState,
    carriage: EncoderState | MotorState,
    guide: GuidePlace | None,
) -> AxisReading:
    return AxisReading(
        cylinder_angle=cylinder.position,
        angular_speed=cylinder.speed,
        carriage_position=carriage.position,
        feed_speed=carriage.speed,
        guide=guide,
    )
