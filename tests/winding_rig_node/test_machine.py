"""The machine: motor, encoder, PID, speeds, phases, judgement of its sensors, flow control."""

import math
from dataclasses import replace

import numpy as np
import pytest
from commanded_machine import machine, run, winding

from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile
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
from winding_rig_node.machine.faults import Faults, parse_faults
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import (
    SENSORS,
    MachineConfig,
    Phase,
    PhaseError,
    cylinder_axis,
)
from winding_rig_node.machine.pace import Pace

FULL_SPEED = DriveProfile().angular_speed
# A stop takes 0.3 s from full speed; the bar of the fault table is 0.5 s.
STAND_WITHIN = 0.5
IMPOSSIBLE = {
    "cylinder_encoder:off": "cylinder encoder gives no valid reading",
    "cylinder_encoder:stuck": "cylinder encoder is stuck",
    "cylinder_encoder:garbage": "cylinder encoder gives no valid reading",
    "cylinder_encoder:wrong:-1": "cylinder encoder",
    "cylinder_encoder:wrong:0.5": "cylinder encoder",
    "carriage_encoder:stuck": "carriage encoder",
    "carriage_encoder:wrong:-1": "carriage encoder",
    "load_cell:off": "load cell gives no valid reading",
    "load_cell:garbage": "load cell gives no valid reading",
    "load_cell:stuck": "load cell is stuck",
    "load_cell:wrong:0.1": "tension is outside",
    "load_cell:wrong:5": "tension is outside",
}
DT = 1.0e-3


def started(case: int = 4, duration: float = 60.0) -> Machine:
    rig = machine(case, duration)
    rig.start()
    return rig


def wind(rig: Machine) -> np.ndarray:
    """Wind to the end; return rows (t, Theta, omega, z, feed)."""
    rig.start()
    rows = []
    while rig.moving:
        rig.step()
        rows.append((rig.time, *rig.reading().numbers))
    return np.array(rows)


@pytest.fixture(scope="module", params=[1, 4, 12])
def rows(request: pytest.FixtureRequest) -> np.ndarray:
    return wind(machine(request.param, 20.0))


@pytest.mark.slow
def test_speeds_hold_their_targets_after_the_ramp(rows: np.ndarray) -> None:
    drive = DriveProfile()
    held = rows[rows[:, 0] > drive.ramp_time]
    for column, target in ((2, drive.angular_speed), (4, drive.feed_speed)):
        error = held[:, column] / target - 1.0
        # The bar of the rig: 1 % rms and 3 % overshoot.
        assert np.sqrt(np.mean(error**2)) < 0.01
        assert error.max() < 0.03


def test_positions_follow_the_drive_profile(rows: np.ndarray) -> None:
    angle, guide = DriveProfile().positions(rows[:, 0])
    # Speed error rms 0.1 %, integrated by the controller to nothing: a few milliradians.
    assert np.abs(rows[:, 1] - angle).max() < 0.01
    assert np.abs(rows[:, 3] - guide).max() < 0.1e-3


@pytest.mark.slow
def test_run_has_one_sample_per_millisecond_and_ends_at_its_duration(rows: np.ndarray) -> None:
    assert len(rows) == 20_000
    np.testing.assert_allclose(np.diff(rows[:, 0]), 1.0e-3, atol=1e-12)


@pytest.mark.parametrize(
    ("weight", "cylinder", "feed"),
    # Copper wire behind a slow guide, a power cable, the rope of a crane, a guide that creeps.
    [(15.0, 0.02, 0.24e-3), (40.0, 0.3, 3.2e-3), (5000.0, 0.16, 2.5e-3), (0.5, 0.02, -0.02e-3)],
)
def test_slow_guides_and_heavy_cable_are_wound_without_a_false_stop(
    weight: float, cylinder: float, feed: float
) -> None:
    case = replace(paper_case(4), cylinder_diameter=cylinder, weight=weight)
    drive = DriveProfile(angular_speed=1.0, feed_speed=feed)
    axis = cylinder_axis(case)
    config = MachineConfig(case=case, drive=drive, duration=6.0, cylinder=axis)
    rig = Machine(config, np.random.default_rng(3))
    rows = wind(rig)
    assert rig.state.phase is Phase.FINISHED, rig.state.reason
    angle, guide = drive.positions(rows[:, 0])
    # As with the paper's rig: speed errors of 0.1 % rms, integrated to nothing.
    assert np.abs(rows[:, 1] - angle).max() < 0.01
    assert np.abs(rows[:, 3] - guide).max() < 0.1e-3


def test_an_encoder_that_sticks_behind_a_slow_guide_stops_the_machine() -> None:
    drive = DriveProfile(feed_speed=0.24e-3)
    config = MachineConfig(case=paper_case(4), drive=drive, duration=10.0)
    rig = Machine(config, np.random.default_rng(3))
    rig.start()
    while rig.time < 3.0:
        rig.step()
    rig.faults = Faults(parse_faults("carriage_encoder:stuck", SENSORS))
    run(rig)
    assert rig.state.phase is Phase.PROTECTIVE
    assert "carriage encoder" in rig.state.reason


def test_load_cell_shows_the_weight() -> None:
    rig = started()
    samples = np.array([rig.tension() for _ in range(400)])
    # Noise of 10 mN: three standard errors of 400 samples are 1.5 mN.
    assert samples.mean() == pytest.approx(paper_case(4).weight, abs=1.5e-3)


def test_stop_ramps_down_and_start_resumes_where_it_stood() -> None:
    rig = winding(duration=4.0, until=1.5)
    rig.stop()
    run(rig)
    assert rig.state.phase is Phase.IDLE
    stood = rig.reading().cylinder_angle
    rig.start()
    rig.step()
    assert rig.reading().cylinder_angle == pytest.approx(stood, abs=1e-3)
    run(rig)
    assert rig.state.phase is Phase.FINISHED
    # As far as without a stop, within what its speed passes in a few samples.
    whole = rig.config.drive.reading_at(4.0).cylinder_angle
    assert rig.reading().cylinder_angle == pytest.approx(whole, abs=0.01)


def test_emergency_stop_halts_within_a_tenth_of_a_second() -> None:
    rig = winding(until=1.5)
    rig.emergency_stop()
    begin = rig.time
    run(rig)
    assert rig.time - begin < 0.1


def test_starting_twice_is_starting_once() -> None:
    rig = started()
    rig.step()
    rig.start()
    assert (rig.state.phase, rig.state.sample) == (Phase.WINDING, 1)


def test_reset_while_winding_is_refused() -> None:
    rig = started()
    rig.step()
    with pytest.raises(PhaseError, match="stop it first"):
        rig.reset()


def test_finished_run_can_be_reset_and_wound_again() -> None:
    rig = machine(duration=2.0)
    wind(rig)
    assert rig.state.phase is Phase.FINISHED
    rig.reset()
    assert rig.reading().cylinder_angle == 0.0
    rows = wind(rig)
    assert rig.state.phase is Phase.FINISHED
    assert rows[-1, 0] == pytest.approx(4.0)


def test_same_seed_gives_the_same_run() -> None:
    first, second = machine(duration=1.0, seed=5), machine(duration=1.0, seed=5)
    np.testing.assert_array_equal(wind(first), wind(second))
    assert first.tension() == second.tension()


def break_at(t: float, text: str) -> tuple[Machine, float]:
    """Wind with a fault from t [s] on until the machine stands; return it and the largest speed."""
    rig = started(duration=3.0)
    fastest = 0.0
    while rig.moving:
        if rig.time >= t and not rig.faults:
            rig.faults = Faults(parse_faults(text, SENSORS))
        rig.step()
        fastest = max(fastest, abs(rig.state.cylinder.motor.speed))
    return rig, fastest


@pytest.mark.slow
@pytest.mark.parametrize("case", range(1, 13))
def test_healthy_machine_of_every_case_winds_to_its_end(case: int) -> None:
    rig = started(case, duration=2.5)
    run(rig, 2.0)
    rig.stop()
    run(rig)
    assert rig.state.phase in (Phase.FINISHED, Phase.IDLE)
    assert not rig.plausibility.refused


@pytest.mark.slow
@pytest.mark.parametrize("text", IMPOSSIBLE)
@pytest.mark.parametrize("t", [0.0, 1.5], ids=["from the start", "at full speed"])
def test_sensor_that_cannot_be_right_ends_in_standstill(t: float, text: str) -> None:
    rig, fastest = break_at(t, text)
    state = rig.state
    assert state.phase is Phase.PROTECTIVE
    assert IMPOSSIBLE[text] in state.reason
    assert state.stood_at - state.stop_began <= STAND_WITHIN
    assert state.cylinder.motor.speed == state.carriage.motor.speed == 0.0
    # The controller pushes for the 50 ms before the judgement.
    assert fastest < 2.0 * FULL_SPEED


def test_fault_is_judged_after_fifty_milliseconds() -> None:
    rig, _ = break_at(1.5, "cylinder_encoder:off")
    assert rig.state.stop_began is not None
    # One control step late at most.
    assert rig.state.stop_began - 1.5 == pytest.approx(0.05, abs=0.003)


def test_single_lost_samples_do_not_stop_the_machine() -> None:
    rig, _ = break_at(1.0, "cylinder_encoder:intermittent:0.2,load_cell:intermittent:0.2")
    assert rig.state.phase is Phase.FINISHED


def test_protective_stop_is_latched_until_reset() -> None:
    rig, _ = break_at(1.5, "load_cell:off")
    with pytest.raises(PhaseError, match="cannot start while the machine is in protective stop"):
        rig.start()
    rig.faults = Faults()
    rig.reset()
    rig.start()
    run(rig)
    assert rig.state.phase is Phase.FINISHED


def test_emergency_stop_is_latched_until_reset() -> None:
    rig = winding(until=1.5)
    rig.emergency_stop()
    run(rig)
    for act, name in ((rig.start, "start"), (rig.stop, "stop")):
        with pytest.raises(PhaseError, match=f"cannot {name} while .* in emergency stop"):
            act()
    rig.quick_stop()
    assert rig.state.phase is Phase.EMERGENCY
    rig.reset()
    rig.start()
    assert rig.state.phase is Phase.WINDING


def test_quick_stop_is_resumed_by_start() -> None:
    rig = winding(duration=3.0, until=1.5)
    rig.quick_stop("by hand")
    began = rig.time
    run(rig)
    assert rig.state.phase is Phase.IDLE
    assert rig.state.stood_at is not None
    assert rig.state.stood_at - began <= STAND_WITHIN
    stood = rig.state.cylinder.motor.position
    rig.start()
    assert rig.state.reason == ""
    run(rig)
    assert rig.state.phase is Phase.FINISHED
    assert rig.state.cylinder.motor.position > stood


def test_value_that_cannot_be_never_reaches_controller_or_reader() -> None:
    rig = winding(duration=3.0)
    rig.faults = Faults(parse_faults("cylinder_encoder:garbage,load_cell:garbage", SENSORS))
    while rig.moving:
        rig.step()
        reading = rig.reading()
        assert math.isfinite(reading.cylinder_angle)
        assert math.isfinite(reading.angular_speed)
        assert rig.state.tension is None or math.isfinite(rig.state.tension)
    assert rig.plausibility.refused["cylinder encoder"] > 0
    assert rig.plausibility.refused["load cell"] > 0


def test_without_consumers_time_is_free() -> None:
    assert Pace([], 0.1).limit == math.inf


def test_limit_follows_the_slowest_consumer() -> None:
    pace = Pace(["a", "b"], 0.25)
    pace.answer("a", 5.0)
    pace.answer("b", 1.0)
    assert pace.limit == pytest.approx(1.25)
    assert pace.slowest == "b"


def test_a_stale_answer_does_not_take_time_back() -> None:
    pace = Pace(["a"], 0.25)
    pace.answer("a", 2.0)
    pace.answer("a", 1.0)
    assert pace.limit == pytest.approx(2.25)


def test_zero_lead_is_refused() -> None:
    with pytest.raises(ValueError, match=r"max_lead must be positive, got 0\.0 s"):
        Pace(["a"], 0.0)


def test_motor_at_rest_is_held_by_dry_friction() -> None:
    state = MotorState()
    below = 0.9 * CYLINDER_MOTOR.friction_voltage
    for _ in range(1000):
        advance_motor(CYLINDER_MOTOR, state, below, 0.0, DT)
    assert state.speed == 0.0
    assert state.position == 0.0


def test_motor_reaches_the_speed_of_its_torque_balance() -> None:
    state = MotorState()
    load, volts = 0.1, 10.0
    for _ in range(2000):
        advance_motor(CYLINDER_MOTOR, state, volts, load, DT)
    motor = CYLINDER_MOTOR
    torque = motor.torque_constant * (volts - motor.back_emf * state.speed) / motor.resistance
    resisting = motor.viscous * state.speed + motor.coulomb + load
    # The cogging torque is what may be left over.
    assert torque == pytest.approx(resisting, abs=1.1 * motor.ripple)


def test_brake_stops_the_axis_and_keeps_it() -> None:
    state = MotorState(speed=1.74)
    for _ in range(200):
        advance_motor(CYLINDER_MOTOR, state, 24.0, 0.0, DT, braked=True)
    assert state.speed == 0.0


def test_friction_never_reverses_the_motion() -> None:
    state = MotorState(speed=1.0)
    speeds = []
    for _ in range(2000):
        advance_motor(CYLINDER_MOTOR, state, 0.0, 0.0, DT)
        speeds.append(state.speed)
    assert min(speeds) == 0.0


def test_encoder_counts_whole_steps() -> None:
    config = EncoderConfig(resolution=0.01)
    state = EncoderState()
    read_encoder(config, state, 0.0299, DT)
    assert state.position == pytest.approx(0.02, abs=1e-15)


def test_tracked_speed_has_no_error_at_constant_speed() -> None:
    config = EncoderConfig(resolution=1.0e-6)
    state = EncoderState()
    for sample in range(2000):
        read_encoder(config, state, 1.74 * sample * DT, DT)
    # One count over the loop's time constant 1 / (2 pi 12 Hz) is 7.5e-5 rad/s.
    assert state.speed == pytest.approx(1.74, abs=1e-4)


def test_tracked_speed_follows_a_commanded_ramp_without_lag() -> None:
    config = EncoderConfig(resolution=1.0e-7)
    state = EncoderState()
    for sample in range(1, 1001):
        read_encoder(config, state, 0.5 * 1.74 * (sample * DT) ** 2, DT, acceleration=1.74)
    assert state.speed == pytest.approx(1.74, rel=2e-3)  # one sample of a 1 s ramp is 1e-3


def test_integrator_does_not_wind_up_while_the_output_is_saturated() -> None:
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


def test_setpoint_step_gives_no_derivative_kick() -> None:
    config = PidConfig(proportional=0.0, integral=0.0, derivative=1.0, limit=5.0, tracking_time=1.0)
    state = PidState()
    step_pid(config, state, setpoint=0.0, measured=0.0, feedforward=0.0, dt=0.002)
    assert step_pid(config, state, setpoint=9.0, measured=0.0, feedforward=0.0, dt=0.002) == 0.0


def test_too_slow_a_loop_is_refused_with_its_limit() -> None:
    with pytest.raises(ValueError, match=r"bandwidth must exceed .* Hz"):
        tuned_pid(CYLINDER_MOTOR, 0.1)


def test_encoder_without_resolution_is_refused() -> None:
    with pytest.raises(ValueError, match="resolution must be positive, got nan"):
        EncoderConfig(resolution=math.nan)
