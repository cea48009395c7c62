"""One driven axis: motor, encoder and speed controller in a loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from winding_rig_node.machine.encoder import EncoderConfig, EncoderState, read_encoder
from winding_rig_node.machine.motor import MotorConfig, MotorState, advance_motor
from winding_rig_node.machine.pid import PidConfig, PidState, step_pid


@dataclass(frozen=True, kw_only=True)
class AxisConfig:
    """Motor, encoder and controller gains of one axis.

    Attributes:
        motor: Electrical and mechanical constants.
        encoder: Resolution and noise.
        pid: Gains.
    """

    motor: MotorConfig
    encoder: EncoderConfig
    pid: PidConfig


@dataclass(kw_only=True)
class AxisState:
    """Everything that changes on one axis.

    Attributes:
        motor: True position and speed.
        encoder: What is measured of them.
        pid: Integrator and last measurement.
        voltage: At the motor [V].
        acceleration: Of the setpoint [rad/s^2 or m/s^2].
        feedforward: Share of the voltage that is not from the controller [V].
        setpoint: Wanted speed [rad/s or m/s].
    """

    motor: MotorState = field(default_factory=MotorState)
    encoder: EncoderState = field(default_factory=EncoderState)
    pid: PidState = field(default_factory=PidState)
    voltage: float = 0.0
    acceleration: float = 0.0
    feedforward: float = 0.0
    setpoint: float = 0.0


def tuned_pid(motor: MotorConfig, bandwidth: float) -> PidConfig:
    """Return gains by pole placement on the motor's first-order speed response.

    Args:
        motor: The axis; its time constant tau and speed per volt K.
        bandwidth: Natural frequency of the closed loop [Hz]; critically damped.

    Raises:
        ValueError: The loop would be slower than the motor by itself.
    """
    omega = 2.0 * math.pi * bandwidth
    tau, gain = motor.time_constant, motor.speed_per_volt
    proportional = (2.0 * omega * tau - 1.0) / gain
    if proportional <= 0.0:
        raise ValueError(
            f"bandwidth must exceed {1.0 / (4.0 * math.pi * tau):.3g} Hz for a motor with a time "
            f"constant of {tau:.3g} s, got {bandwidth:g} Hz"
        )
    return PidConfig(
        proportional=proportional,
        integral=omega * omega * tau / gain,
        derivative=0.02 * tau / gain,
        limit=motor.supply,
        tracking_time=1.0 / omega,
    )


def control_axis(
    config: AxisConfig,
    state: AxisState,
    *,
    setpoint: float,
    acceleration: float,
    dt: float,
    load: float = 0.0,
    open_loop: bool = False,
) -> None:
    """Set the axis voltage for a speed setpoint and its known acceleration.

    Args:
        config: The axis.
        state: Its state.
        setpoint: Wanted speed [rad/s or m/s].
        acceleration: Its rate [rad/s^2 or m/s^2].
        dt: Control period [s].
        load: Opposing load that the drive knows of [N m or N]; counts only without the encoder.
        open_loop: Whether the motor's model alone drives the axis, because its encoder lies.
    """
    motor = config.motor
    dry = math.copysign(motor.friction_voltage, setpoint) if setpoint else 0.0
    feedforward = (setpoint + motor.time_constant * acceleration) / motor.speed_per_volt + dry
    state.acceleration = acceleration
    state.setpoint, state.feedforward = setpoint, feedforward
    if open_loop:
        state.voltage = feedforward + load * motor.resistance / motor.torque_constant
        return
    state.voltage = step_pid(
        config.pid,
        state.pid,
        setpoint=setpoint,
        measured=state.encoder.speed,
        feedforward=feedforward,
        dt=dt,
    )


def modelled_speed(config: AxisConfig, state: AxisState, *, load: float) -> float:
    """Return the speed that the motor's voltage stands for, under a known load [N m or N].

    At the feedforward voltage that is the setpoint; every further volt is further speed.
    """
    motor = config.motor
    load_voltage = load * motor.resistance / motor.torque_constant
    trim = state.voltage - state.feedforward - load_voltage
    return state.setpoint + motor.speed_per_volt * trim


def advance_axis(
    config: AxisConfig,
    state: AxisState,
    *,
    load: float,
    dt: float,
    braked: bool,
    seen: Callable[[float], float | None] = float,
) -> None:
    """Move the axis by one sample period and read its encoder.

    Args:
        config: The axis.
        state: Its state.
        load: Opposing load [N m or N].
        dt: Sample period [s].
        braked: Whether drive is cut and brake applied.
        seen: What the encoder makes of a position; None when it says nothing that can be.
    """
    advance_motor(config.motor, state.motor, state.voltage, load, dt, braked=braked)
    read_encoder(
        config.encoder,
        state.encoder,
        seen(state.motor.position),
        dt,
        acceleration=0.0 if braked else state.acceleration,
    )
