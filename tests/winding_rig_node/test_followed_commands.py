"""What is commanded is followed: streams and trajectories within half a millimetre."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from commanded_machine import carriage, course, run, targets, winding

from winding_core.commands import AxisTarget, Command
from winding_rig_node.machine.commander import CARRIAGE_LIMITS
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import Phase

# A sine of the carriage: amplitude [m], frequency [Hz], and what it may be missed by [m].
AMPLITUDE, FREQUENCY, MISSED = 20.0e-3, 0.5, 0.5e-3
OMEGA = 2.0 * math.pi * FREQUENCY


def sine(t: float) -> float:
    return AMPLITUDE * math.sin(OMEGA * t)


def from_rest(t: float) -> float:
    """A sine that begins at its turning point: who commands speeds cannot catch up."""
    return AMPLITUDE * (1.0 - math.cos(OMEGA * t))


Sender = Callable[[Machine, float, float], Command]


def by_position(rig: Machine, origin: float, t: float) -> Command:
    return targets(rig.time, carriage=AxisTarget(position=origin + sine(t)))


def by_speed(rig: Machine, origin: float, t: float) -> Command:
    return targets(rig.time, carriage=AxisTarget(speed=AMPLITUDE * OMEGA * math.sin(OMEGA * t)))


@pytest.mark.campaign
@pytest.mark.slow
@pytest.mark.parametrize("rate", [50, 100])
@pytest.mark.parametrize(("send", "meant"), [(by_position, sine), (by_speed, from_rest)])
def test_streamed_sine_is_followed(
    rate: int, send: Sender, meant: Callable[[float], float]
) -> None:
    rig = winding()
    origin, errors = carriage(rig), []
    for count in range(30_000):
        if count % (1000 // rate) == 0:
            rig.command(send(rig, origin, 1.0e-3 * count))
        rig.step()
        if count > 500 / FREQUENCY:
            errors.append(carriage(rig) - origin - meant(1.0e-3 * (count + 1)))
    assert np.abs(errors).max() < MISSED
    assert rig.state.phase is Phase.WINDING


@pytest.mark.campaign
@pytest.mark.slow
def test_a_missing_sample_does_not_tear_a_stream() -> None:
    rig = winding()
    origin, errors = carriage(rig), []
    for count in range(8_000):
        # One of ten is lost.
        if count % 20 == 0 and count % 200 != 100:
            rig.command(by_position(rig, origin, 1.0e-3 * count))
        rig.step()
        if count > 500 / FREQUENCY:
            errors.append(carriage(rig) - origin - sine(1.0e-3 * (count + 1)))
    assert np.abs(errors).max() < MISSED


@pytest.mark.campaign
@pytest.mark.slow
@pytest.mark.parametrize("step", [0.02, 0.1], ids=["lines", "cubics"])
def test_sine_as_a_trajectory_is_followed(step: float) -> None:
    rig = winding()
    origin, times = carriage(rig), np.arange(step, 30.0 + step / 2.0, step)
    rows = np.array([times, origin + AMPLITUDE * (1.0 - np.cos(OMEGA * times))]).T
    if step > 0.05:
        rows = np.column_stack([rows, AMPLITUDE * OMEGA * np.sin(OMEGA * times)])
        rows[-1, 2] = 0.0
    rig.command(course(*map(tuple, rows.tolist())))
    errors = []
    for count in range(1, 30_000):
        rig.step()
        if count > 1000:
            errors.append(carriage(rig) - origin - from_rest(1.0e-3 * count))
    assert np.abs(errors).max() < MISSED
    run(rig, 1.0)
    assert rig.state.phase is Phase.WINDING


def test_the_axis_that_is_not_commanded_stays_on_its_programme() -> None:
    free, led = winding(), winding()
    led.command(targets(carriage=AxisTarget(speed=0.0)))
    for rig in (free, led):
        run(rig, 5.0)
    assert led.reading().cylinder_angle == free.reading().cylinder_angle
    assert carriage(led) < carriage(free) - 0.02


def test_a_step_of_speed_is_limited_to_the_acceleration_of_the_axis() -> None:
    rig = winding()
    speeds = []
    rig.command(targets(carriage=AxisTarget(speed=CARRIAGE_LIMITS.speed)))
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
