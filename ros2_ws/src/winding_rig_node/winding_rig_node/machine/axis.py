"""One driven axis: geared DC motor, incremental encoder and PID speed controller in a loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace


@dataclass(frozen=True, kw_only=True)
class PidConfig:
    """Gains of one axis."""

    proportional: float  # [V per unit of speed error]
    integral: float  # [V per unit of speed error and second]
    derivative: float  # [V per unit of measured acceleration]
    limit: float  # Largest output magnitude [V]
    tracking_time: float  # Time in which a saturated integrator is led back [s]

    def __post_init__(self) -> None:
        if not self.limit > 0.0:
            raise ValueError(f"limit must be positive, got {self.limit} V")
        if not self.tracking_time > 0.0:
            raise ValueError(f"tracking_time must be positive, got {self.tracking_time} s")


@dataclass(kw_only=True)
class PidState:
    """Integrator `integral` [V] and the speed last `measured` [rad/s or m/s]."""

    integral: float = 0.0
    measured: float | None = None


def step_pid(
    config: PidConfig,
    state: PidState,
    *,
    setpoint: float,
    measured: float,
    feedforward: float,
    dt: float,
) -> float:
    """Return the output [V] of one control step of dt [s].

    The derivative acts on the measurement, so that a setpoint step gives no kick. When the
    output saturates, the integrator follows what the actuator really got (back-calculation).
    """
    error = setpoint - measured
    acceleration = 0.0 if state.measured is None else (measured - state.measured) / dt
    state.measured = measured
    wanted = (
        feedforward
        + config.proportional * error
        + state.integral
        - config.derivative * acceleration
    )
    output = min(max(wanted, -config.limit), config.limit)
    state.integral += dt * (config.integral * error + (output - wanted) / config.tracking_time)
    return output


@dataclass(frozen=True, kw_only=True)
class EncoderConfig:
    """Encoder of one axis."""

    resolution: float  # Axis way per count [rad or m]
    bandwidth: float = 12.0  # Natural frequency of the tracking loop that estimates speed [Hz]

    def __post_init__(self) -> None:
        if not self.resolution > 0.0:
            raise ValueError(f"encoder resolution must be positive, got {self.resolution}")


# 2048 lines, read fourfold, in front of a 1:25 gear; and on a screw of 5 mm lead.
CYLINDER_ENCODER = EncoderConfig(resolution=2.0 * math.pi / (8192 * 25))
CARRIAGE_ENCODER = EncoderConfig(resolution=5.0e-3 / 8192)


@dataclass(kw_only=True)
class EncoderState:
    """Last count and the tracking loop's estimate."""

    position: float = 0.0  # Of the last count [rad or m]
    tracked: float = 0.0  # The loop's position [rad or m]
    speed: float = 0.0  # The loop's speed [rad/s or m/s]


def read_encoder(
    config: EncoderConfig,
    state: EncoderState,
    position: float | None,
    dt: float,
    *,
    acceleration: float = 0.0,
) -> None:
    """Sample the axis position; update counted position and estimated speed.

    The tracking loop is critically damped and spreads one count over its time constant. Fed with
    the commanded acceleration it follows a ramp of speed without lag. Without a position the
    count stays and the estimate goes on by itself.
    """
    if position is None:
        state.speed += dt * acceleration
        state.tracked += dt * state.speed
        return
    state.position = config.resolution * math.floor(position / config.resolution)
    omega = 2.0 * math.pi * config.bandwidth
    predicted = state.tracked + dt * state.speed
    innovation = state.position + 0.5 * config.resolution - predicted
    state.tracked = predicted + 2.0 * omega * dt * innovation
    state.speed += dt * (acceleration + omega * omega * innovation)


@dataclass(frozen=True, kw_only=True)
class MotorConfig:
    """Motor, gear and load reduced to the axis: [rad] for a rotary one, [m] for a linear one."""

    supply: float  # Largest voltage [V]
    resistance: float  # Winding resistance [Ohm]
    torque_constant: float  # Axis torque or force per ampere [N m/A or N/A]
    back_emf: float  # Voltage per axis speed [V s/rad or V s/m]
    inertia: float  # Everything that moves, reduced to the axis [kg m^2 or kg]
    viscous: float  # Friction per speed [N m s/rad or N s/m]
    coulomb: float  # Dry friction [N m or N]
    brake: float  # Dry friction of the holding brake when it is applied [N m or N]
    ripple: float  # Amplitude of the cogging torque [N m or N]
    ripple_period: float  # Way per cogging period [rad or m]

    @property
    def speed_per_volt(self) -> float:
        """Steady axis speed per volt without dry friction."""
        return self.torque_constant / (
            self.torque_constant * self.back_emf + self.resistance * self.viscous
        )

    @property
    def time_constant(self) -> float:
        """Mechanical time constant [s]; the electrical one is far shorter and left out."""
        return self.inertia / (
            self.viscous + self.torque_constant * self.back_emf / self.resistance
        )

    @property
    def friction_voltage(self) -> float:
        """Voltage that overcomes the dry friction [V]."""
        return self.coulomb * self.resistance / self.torque_constant

    @property
    def cogging_speed(self) -> float:
        """Speed [rad/s or m/s] of the voltage that overcomes the cogging."""
        return self.speed_per_volt * self.ripple * self.resistance / self.torque_constant

    def times(self, factor: float) -> MotorConfig:
        """Return a motor that does the same under a load larger by a factor.

        Time constant and speed per volt, and with them the gains of its controller, stay.
        """
        return replace(
            self,
            resistance=self.resistance / factor,
            inertia=factor * self.inertia,
            viscous=factor * self.viscous,
            coulomb=factor * self.coulomb,
            brake=factor * self.brake,
            ripple=factor * self.ripple,
        )


CYLINDER_MOTOR = MotorConfig(
    supply=24.0,
    resistance=2.0,
    torque_constant=2.2,
    back_emf=2.2,
    inertia=0.12,
    viscous=0.05,
    coulomb=0.25,
    brake=12.0,
    ripple=0.02,
    ripple_period=2.0 * math.pi / 36.0,
)
CARRIAGE_MOTOR = MotorConfig(
    supply=60.0,
    resistance=2.0,
    torque_constant=480.0,
    back_emf=480.0,
    inertia=5760.0,
    viscous=40.0,
    coulomb=40.0,
    brake=3000.0,
    ripple=4.0,
    ripple_period=1.0e-3,
)


@dataclass(kw_only=True)
class MotorState:
    """True `position` [rad or m] and `speed` [rad/s or m/s] of the axis."""

    position: float = 0.0
    speed: float = 0.0


def advance_motor(
    config: MotorConfig,
    state: MotorState,
    voltage: float,
    load: float,
    dt: float,
    *,
    braked: bool = False,
) -> None:
    """Advance an axis by dt [s] under a voltage [V] and an opposing load [N m or N].

    With the brake on the drive is cut. Dry friction opposes motion, and holds the axis while
    it can: speed never changes sign within a step because of friction.
    """
    volts = 0.0 if braked else min(max(voltage, -config.supply), config.supply)
    drive = (
        0.0
        if braked
        else config.torque_constant * (volts - config.back_emf * state.speed) / config.resistance
    )
    cogging = config.ripple * math.sin(2.0 * math.pi * state.position / config.ripple_period)
    force = drive - config.viscous * state.speed - load + cogging
    dry = config.coulomb + (config.brake if braked else 0.0)
    free_speed = state.speed + dt * force / config.inertia
    lost_speed = dt * dry / config.inertia
    if abs(free_speed) <= lost_speed:
        new_speed = 0.0
    else:
        new_speed = free_speed - math.copysign(lost_speed, free_speed)
    state.position += 0.5 * dt * (state.speed + new_speed)
    state.speed = new_speed


@dataclass(frozen=True, kw_only=True)
class AxisConfig:
    """Motor, encoder and controller gains of one axis."""

    motor: MotorConfig  # Electrical and mechanical constants
    encoder: EncoderConfig  # Resolution and noise
    pid: PidConfig  # Gains


@dataclass(kw_only=True)
class AxisState:
    """Everything that changes on one axis."""

    motor: MotorState = field(default_factory=MotorState)  # True position and speed
    encoder: EncoderState = field(default_factory=EncoderState)  # What is measured of them
    pid: PidState = field(default_factory=PidState)  # Integrator and last measurement
    voltage: float = 0.0  # At the motor [V]
    acceleration: float = 0.0  # Of the setpoint [rad/s^2 or m/s^2]
    feedforward: float = 0.0  # Share of the voltage that is not from the controller [V]
    setpoint: float = 0.0  # Wanted speed [rad/s or m/s]


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
        open_loop: Whether the motor's model alone drives the axis, because its encoder is wrong.
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
        seen: What the encoder makes of a position; None when its reading is invalid.
    """
    advance_motor(config.motor, state.motor, state.voltage, load, dt, braked=braked)
    read_encoder(
        config.encoder,
        state.encoder,
        seen(state.motor.position),
        dt,
        acceleration=0.0 if braked else state.acceleration,
    )
