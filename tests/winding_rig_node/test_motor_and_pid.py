"""The drive: what a motor, an encoder and a PID must do whatever their numbers."""

import math

import pytest

from winding_rig_node.machine.axis import (
    CYLINDER_MOTOR,
    EncoderConfig,
    EncoderState,
    MotorState,
    PidConfig,
    PidState,
    advance_motor,
    read_encoder,
    step_pid,
    tuned_pid,
)

DT = 1.0e-3


def test_motor_at_rest_is_held_by_dry_friction():
    state = MotorState()
    below = 0.9 * CYLINDER_MOTOR.friction_voltage
    for _ in range(1000):
        advance_motor(CYLINDER_MOTOR, state, below, 0.0, DT)
    assert state.speed == 0.0
    assert state.position == 0.0


def test_motor_reaches_the_speed_of_its_torque_balance():
    state = MotorState()
    load, volts = 0.1, 10.0
    for _ in range(2000):
        advance_motor(CYLINDER_MOTOR, state, volts, load, DT)
    motor = CYLINDER_MOTOR
    torque = motor.torque_constant * (volts - motor.back_emf * state.speed) / motor.resistance
    resisting = motor.viscous * state.speed + motor.coulomb + load
    # The cogging torque is what may be left over.
    assert torque == pytest.approx(resisting, abs=1.1 * motor.ripple)


def test_brake_stops_the_axis_and_keeps_it():
    state = MotorState(speed=1.74)
    for _ in range(200):
        advance_motor(CYLINDER_MOTOR, state, 24.0, 0.0, DT, braked=True)
    assert state.speed == 0.0


def test_friction_never_reverses_the_motion():
    state = MotorState(speed=1.0)
    speeds = []
    for _ in range(2000):
        advance_motor(CYLINDER_MOTOR, state, 0.0, 0.0, DT)
        speeds.append(state.speed)
    assert min(speeds) == 0.0


def test_encoder_counts_whole_steps():
    config = EncoderConfig(resolution=0.01)
    state = EncoderState()
    read_encoder(config, state, 0.0299, DT)
    assert state.position == pytest.approx(0.02, abs=1e-15)


def test_tracked_speed_has_no_error_at_constant_speed():
    config = EncoderConfig(resolution=1.0e-6)
    state = EncoderState()
    for sample in range(2000):
        read_encoder(config, state, 1.74 * sample * DT, DT)
    # One count over the loop's time constant 1 / (2 pi 12 Hz) is 7.5e-5 rad/s.
    assert state.speed == pytest.approx(1.74, abs=1e-4)


def test_tracked_speed_follows_a_commanded_ramp_without_lag():
    config = EncoderConfig(resolution=1.0e-7)
    state = EncoderState()
    for sample in range(1, 1001):
        read_encoder(config, state, 0.5 * 1.74 * (sample * DT) ** 2, DT, acceleration=1.74)
    assert state.speed == pytest.approx(1.74, rel=2e-3)  # one sample of a 1 s ramp is 1e-3


def test_integrator_does_not_wind_up_while_the_output_is_saturated():
    config = PidConfig(
        proportional=1.0, integral=10.0, derivative=0.0, limit=5.0, tracking_time=0.05
    )
    state = PidState()
    for _ in range(5000):
        output = step_pid(config, state, setpoint=100.0, measured=0.0, feedforward=0.0, dt=0.002)
    assert output == 5.0
    recovery = [
        step_pid(config, state, setpoint=0.0, measured=1.0, feedforward=0.0, dt=0.002)
        for _ in range(200)
    ]
    # Without anti-windup the integral would be 10 s x 1000 and hold the limit for seconds.
    assert recovery[-1] < 0.0


def test_setpoint_step_gives_no_derivative_kick():
    config = PidConfig(proportional=0.0, integral=0.0, derivative=1.0, limit=5.0, tracking_time=1.0)
    state = PidState()
    step_pid(config, state, setpoint=0.0, measured=0.0, feedforward=0.0, dt=0.002)
    assert step_pid(config, state, setpoint=9.0, measured=0.0, feedforward=0.0, dt=0.002) == 0.0


def test_too_slow_a_loop_is_refused_with_its_limit():
    with pytest.raises(ValueError, match=r"bandwidth must exceed .* Hz"):
        tuned_pid(CYLINDER_MOTOR, 0.1)


def test_encoder_without_resolution_is_refused():
    with pytest.raises(ValueError, match="resolution must be positive, got nan"):
        EncoderConfig(resolution=math.nan)
