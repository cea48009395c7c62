"""Commands are followed, refused with value and limit, and end in a stop when they cease."""

import math
from collections.abc import Callable
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest
from commanded_machine import (
    AMPLITUDE,
    MISSED,
    OMEGA,
    carriage,
    course,
    from_rest,
    guide,
    machine,
    run,
    sine,
    sine_speed,
    targets,
    winding,
)

from winding_core.machine.commands import AxisTarget, Command, JointTrajectory, TensionCommand
from winding_core.machine.drive import DriveProfile
from winding_rig_node.machine.commander import CARRIAGE_LIMITS, CommandError
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import Phase, PhaseError

Target = Callable[[float, float], AxisTarget]


def by_position(origin: float, t: float) -> AxisTarget:
    return AxisTarget(position=origin + sine(t))


def by_speed(origin: float, t: float) -> AxisTarget:
    return AxisTarget(speed=sine_speed(t))


def missed(
    rig: Machine, meant: Callable[[float], float], samples: int, send: Target, due: Any
) -> float:
    """Return by how much a carriage misses a course [m] once it has caught up for a second.

    Args:
        rig: Winds.
        meant: The course over time [s], from where the carriage stands.
        samples: Of the machine.
        send: Makes the target of that place [m] and a time [s].
        due: Whether a target is sent at a sample.
    """
    origin, errors = carriage(rig), []
    for count in range(samples):
        if due(count):
            rig.command(targets(rig.time, carriage=send(origin, 1.0e-3 * count)))
        rig.step()
        if count >= 1000:
            errors.append(carriage(rig) - origin - meant(1.0e-3 * (count + 1)))
    return float(np.abs(errors).max())


@pytest.mark.campaign
@pytest.mark.parametrize("rate", [50, 100])
@pytest.mark.parametrize(("send", "meant"), [(by_position, sine), (by_speed, from_rest)])
def test_streamed_sine_is_followed(rate: int, send: Target, meant: Any) -> None:
    rig = winding()
    assert missed(rig, meant, 30_000, send, lambda count: count % (1000 // rate) == 0) < MISSED
    assert rig.state.phase is Phase.WINDING


@pytest.mark.campaign
def test_a_missing_sample_does_not_tear_a_stream() -> None:
    def due(count: int) -> bool:
        # One of ten is lost.
        return count % 20 == 0 and count % 200 != 100

    assert missed(winding(), sine, 8_000, by_position, due) < MISSED


@pytest.mark.campaign
@pytest.mark.parametrize("step", [0.02, 0.1], ids=["lines", "cubics"])
def test_sine_as_a_trajectory_is_followed(step: float) -> None:
    rig = winding()
    origin, times = carriage(rig), np.arange(step, 30.0 + step / 2.0, step)
    rows = np.array([times, origin + AMPLITUDE * (1.0 - np.cos(OMEGA * times))]).T
    if step > 0.05:
        rows = np.column_stack([rows, AMPLITUDE * OMEGA * np.sin(OMEGA * times)])
        rows[-1, 2] = 0.0
    rig.command(course(*map(tuple, rows.tolist())))
    assert missed(rig, from_rest, 29_999, by_position, lambda count: False) < MISSED
    run(rig, 1.0)
    assert rig.state.phase is Phase.WINDING


def test_the_axis_that_is_not_commanded_stays_on_its_programme() -> None:
    free, led = winding(), winding()
    led.command(guide(speed=0.0))
    for rig in (free, led):
        run(rig, 5.0)
    assert led.reading().cylinder_angle == free.reading().cylinder_angle
    assert carriage(led) < carriage(free) - 0.02


def test_a_step_of_speed_is_limited_to_the_acceleration_of_the_axis() -> None:
    rig = winding()
    speeds = []
    rig.command(guide(speed=CARRIAGE_LIMITS.speed))
    for _ in range(400):
        rig.step()
        speeds.append(rig.state.carriage.motor.speed)
    gained = np.array(speeds[50:]) - np.array(speeds[:-50])
    # The drive may be a tenth off its setpoint for a moment, as friction turns.
    assert gained.max() < 1.1 * CARRIAGE_LIMITS.acceleration * 0.05
    assert speeds[-1] == pytest.approx(CARRIAGE_LIMITS.speed, rel=0.01)


def test_a_new_trajectory_replaces_the_old_one() -> None:
    rig = winding()
    rig.command(course((2.0, 0.1)))
    run(rig, 0.5)
    turned = carriage(rig)
    rig.command(course((1.0, turned), (2.0, turned)))
    run(rig, 3.0)
    assert carriage(rig) == pytest.approx(turned, abs=5.0e-6)


def refused(rig: Machine, command: Command) -> str:
    """Return why a command is refused, which changes nothing."""
    before = (dict(rig.commander.axes), rig.commander.brake)
    with pytest.raises(CommandError) as caught:
        rig.command(command)
    assert (rig.commander.axes, rig.commander.brake) == before
    assert rig.commander.refusal == str(caught.value)
    return str(caught.value)


def test_a_refused_command_leaves_every_number_as_it_was() -> None:
    rigs = winding(), winding()
    refused(rigs[0], targets(carriage=AxisTarget(position=2.0), cylinder=AxisTarget(speed=1.0)))
    for rig in rigs:
        run(rig, 2.0)
    assert astuple(rigs[0].reading()) == astuple(rigs[1].reading())
    assert rigs[0].state.tension == rigs[1].state.tension


STAYS = "the carriage trajectory must stay within"
ENDS = "the carriage trajectory must end"
LATE = "a command must be stamped within 0.5 s of the machine's time, 1.000 s, it is of 12.000 s"
CUBIC = course((0.5, 0.02, 0.0), (0.6, 0.025, 0.05), (2.0, 0.03, 0.0))
REFUSED = [
    (guide(position=1.2), "carriage position must lie in -0.1 to 1 m, got 1.2"),
    (guide(speed=-0.2), "carriage speed must be at most 0.08 m/s, got -0.2"),
    (targets(cylinder=AxisTarget(speed=9.0)), "cylinder speed must be at most 8 rad/s, got 9"),
    (targets(12.0, cylinder=AxisTarget(speed=1.0)), LATE),
    (course((1.0, 0.1)), f"{STAYS} 0.08 m/s, it asks for 0.0975 at 0.000 s from now"),
    (
        course((0.5, 0.02, 0.0), (0.7, 0.033, 0.0)),
        f"{STAYS} 0.08 m/s, it asks for 0.0975 at 0.600 s from now",
    ),
    (CUBIC, f"{STAYS} 0.5 m/s^2, it asks for 2 at 0.500 s from now"),
    (course((1.0, -0.05), (2.0, -0.12)), "carriage position must lie in -0.1 to 1 m, got -0.12"),
    (course((1.0, 0.01, 0.01)), f"{ENDS} at rest, it ends at 0.01 m/s"),
    (course((0.1, 0.01), t=0.5), f"{ENDS} after now, 1.000 s, it ends at 0.600 s"),
    (TensionCommand(t=0.0, force=25.0), "tension must lie in 0.1 to 20 N, got 25"),
]


@pytest.mark.parametrize(("command", "sentence"), REFUSED)
def test_what_is_out_of_bounds_is_refused_with_its_limit(command: Command, sentence: str) -> None:
    assert refused(winding(), command) == sentence


def test_a_cubic_that_overshoots_the_travel_is_refused() -> None:
    rig = winding()
    # Both ends lie within; the way on from -0.09 m at -0.05 m/s does not.
    assert refused(rig, course((4.0, -0.09, -0.05), (8.0, -0.09, 0.0))).startswith(
        "carriage position must lie in -0.1 to 1 m, got -0.1"
    )


PHASES: dict[str, Callable[[Machine], object]] = {
    "idle": Machine.reset,
    "stopping": Machine.stop,
    "emergency stop": Machine.emergency_stop,
    "protective stop": lambda rig: rig.protect("on purpose"),
}


@pytest.mark.parametrize("phase", PHASES)
def test_only_a_machine_that_winds_takes_commands(phase: str) -> None:
    rig = machine() if phase == "idle" else winding()
    PHASES[phase](rig)
    sentence = f"commands are taken while the machine winds, it is in {phase}"
    assert refused(rig, guide(speed=0.01)) == sentence


def test_a_stream_that_stops_in_motion_stops_both_axes() -> None:
    rig = winding()
    rig.command(guide(speed=0.05))
    run(rig, 0.45)
    assert rig.state.phase is Phase.WINDING
    run(rig, 3.0)
    assert rig.state.phase is Phase.IDLE
    assert rig.state.reason == (
        "no command for the carriage for more than 0.5 s while it moves at 0.05 m/s"
    )
    assert rig.state.cylinder.motor.speed == rig.state.carriage.motor.speed == 0.0


def test_a_way_that_nobody_attends_is_not_gone_to_its_end() -> None:
    rig = winding()
    rig.command(guide(position=0.3))
    run(rig, 3.0)
    assert rig.state.phase is Phase.IDLE
    assert carriage(rig) < 0.1


@pytest.mark.parametrize(
    "command",
    [
        guide(position=0.01),
        guide(speed=0.0),
        course((2.0, 0.05)),
        JointTrajectory(t=0.0, axes={"carriage": (), "cylinder": ()}),
    ],
)
def test_what_is_reached_stands_or_ends_by_itself_needs_no_stream(command: Command) -> None:
    rig = winding()
    rig.command(command)
    run(rig, 4.0)
    assert rig.state.phase is Phase.WINDING
    assert rig.state.carriage.motor.speed == pytest.approx(0.0, abs=1.0e-5)
    where = carriage(rig)
    run(rig, 4.0)
    assert rig.state.reason == ""
    # One count of the encoder is 0.6 micrometres.
    assert carriage(rig) == pytest.approx(where, abs=2.0e-6)


def test_a_speed_towards_the_end_of_the_travel_stops_before_it() -> None:
    rig = winding()
    while rig.state.phase is Phase.WINDING:
        if rig.state.drive_sample % 20 == 0:
            rig.command(targets(rig.time, carriage=AxisTarget(speed=-0.08)))
        rig.step()
    run(rig, 3.0)
    assert "has to stop before the end of its travel at -0.1 m" in rig.state.reason
    assert CARRIAGE_LIMITS.low <= carriage(rig) < CARRIAGE_LIMITS.low + 5.0e-3


def test_start_gives_the_axes_back_to_the_programme() -> None:
    rig = winding()
    rig.command(guide(position=0.02))
    run(rig, 1.0)
    rig.stop()
    run(rig, 3.0)
    where, asked = carriage(rig), rig.setpoints().carriage_position
    rig.start()
    assert rig.setpoints().carriage_position == pytest.approx(asked)
    run(rig, 5.0)
    assert carriage(rig) == pytest.approx(where + 4.5 * DriveProfile().feed_speed, abs=0.1e-3)
    assert "carriage" not in rig.commander.axes


def test_start_waits_until_commanded_axes_stand() -> None:
    rig = winding()
    rig.command(guide(speed=0.05))
    run(rig, 0.3)
    rig.stop()
    with pytest.raises(PhaseError, match="a commanded axis is coming to rest"):
        rig.start()


@pytest.mark.parametrize("stop", [Machine.quick_stop, Machine.emergency_stop])
def test_a_hurried_stop_brings_commanded_axes_to_rest(stop: Callable[[Machine], object]) -> None:
    rig = winding()
    rig.command(targets(carriage=AxisTarget(speed=0.08), cylinder=AxisTarget(speed=4.0)))
    run(rig, 0.45)
    stop(rig)
    began = rig.time
    run(rig, 3.0)
    assert rig.state.stood_at is not None
    # 0.3 s to rest, and what the brake needs for the last of it.
    assert rig.state.stood_at - began < 0.35


def test_the_brake_follows_a_tension_command_with_its_lag() -> None:
    rig = winding()
    rig.command(TensionCommand(t=0.0, force=4.0))
    weight = rig.config.case.weight
    run(rig, rig.config.commands.brake_time)
    # After one time constant of a first order; three deviations of the load cell's noise.
    lagged = 4.0 + (weight - 4.0) * math.exp(-1.0)
    assert rig.state.tension == pytest.approx(lagged, abs=0.04)
    run(rig, 3.0)
    assert rig.state.tension == pytest.approx(4.0, abs=0.04)
    assert rig.state.phase is Phase.WINDING


def test_reset_puts_the_dead_weight_back() -> None:
    rig = winding()
    rig.command(TensionCommand(t=0.0, force=4.0))
    rig.stop()
    run(rig, 3.0)
    rig.reset()
    rig.start()
    assert rig.state.tension == pytest.approx(rig.config.case.weight, abs=0.04)
