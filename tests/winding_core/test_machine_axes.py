"""Joints of any machine become the axes of a run, and what readings cannot be is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from winding_core.machine.axes import AxisReader, JointSample, MachineAxes, wrong_axis
from winding_core.machine.drive import DriveProfile
from winding_core.machine.incoming_readings import (
    LEAD_IN,
    LoadedReading,
    MotionStart,
    ReadingLimits,
)
from winding_core.machine.readings import AxisReading

DRIVE = DriveProfile()


def reading(angle: float, position: float, omega: float = 0.0, feed: float = 0.0) -> AxisReading:
    return AxisReading(
        cylinder_angle=angle, angular_speed=omega, carriage_position=position, feed_speed=feed
    )


def wound(t: float, sample_rate: float, axes: MachineAxes) -> AxisReading:
    """Return the reading at t of a machine whose driver reports positions alone."""
    read = AxisReader(axes)
    times = np.arange(0.0, t + 0.5 / sample_rate, 1.0 / sample_rate)
    for now in times:
        angle, way = DRIVE.positions(float(now))
        found = read.read(
            JointSample(
                t=1.8e9 + float(now),
                cylinder=axes.cylinder_offset + angle / axes.cylinder_scale,
                carriage=axes.carriage_offset + way / axes.carriage_scale,
            )
        )
    return found


def test_a_standing_machine_is_at_the_origin_wherever_its_encoders_count_from() -> None:
    axes = MachineAxes(cylinder_scale=-1.0).standing_at([(37.2, 0.1), (37.2002, 0.1)])
    angle, position = axes.positions(37.2001, 0.1)
    assert (angle, position) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert axes.positions(36.2001, 0.15) == pytest.approx((1.0, 0.05))


@pytest.mark.parametrize("rate", [40.0, 100.0, 500.0, 2000.0])
@pytest.mark.parametrize("t", [0.5, 3.0])
def test_speeds_that_are_not_reported_are_the_slopes_of_positions(rate: float, t: float) -> None:
    axes = MachineAxes(cylinder_scale=math.radians(1.0), cylinder_offset=2131.0)
    omega, feed = DRIVE.speeds(t)
    found = wound(t, rate, axes)
    # Stamps since the epoch are whole multiples of 0.24 us, a tenth of a promille of 10 ms.
    assert found.angular_speed == pytest.approx(omega, rel=1e-3)
    assert found.feed_speed == pytest.approx(feed, rel=1e-3)


@pytest.mark.parametrize(
    ("angle", "way", "sentence"),
    [
        (-1.0, 1.0, "cylinder turned backwards"),
        (1.0, -1.0, "carriage moved backwards"),
        (math.degrees(1.0), 1.0, "cylinder_scale must give radians"),
        (1.0, 1000.0, "carriage_scale must give metres"),
    ],
)
def test_a_wrong_direction_or_unit_is_named(angle: float, way: float, sentence: str) -> None:
    theta, z = DRIVE.positions(1.0)
    assert wrong_axis(reading(theta, z), 1.0, DRIVE) == ""
    assert sentence in wrong_axis(reading(angle * theta, way * z), 1.0, DRIVE)


@pytest.mark.parametrize(
    ("share", "ahead", "lead"),
    [
        # A controlled carriage may go ahead of the cable, or backwards where it is wanted there.
        (1.0, 0.033, 0.033), (1.0, 0.0099, 0.033), (1.0, -0.033, -0.033),
        # A machine that is slower than the condition.
        (0.2, 0.0, 0.0),
    ],
)  # fmt: skip
def test_other_motion_is_no_wrong_axis(share: float, ahead: float, lead: float) -> None:
    theta, z = DRIVE.positions(1.0)
    assert wrong_axis(reading(share * theta, share * z + ahead), 1.0, DRIVE, lead) == ""
    assert "must give metres" in wrong_axis(reading(theta, 1000.0 * z), 1.0, DRIVE, abs(lead))


def test_swapped_axes_are_named() -> None:
    theta, z = DRIVE.positions(1.0)
    assert "are swapped" in wrong_axis(reading(z, theta), 1.0, DRIVE)


def test_a_run_begins_with_the_first_motion_and_half_a_second_of_standstill() -> None:
    start: MotionStart[LoadedReading] = MotionStart(awaited=True)
    passed = []
    for k in range(1000):
        t = 1.8e9 + 0.01 * k
        angle = 1e-4 * (-1) ** k if k < 900 else 0.01 * (k - 899)
        item = LoadedReading(t=t, reading=reading(angle, 0.0), tension=None)
        passed += [loaded.t - 1.8e9 for loaded in start.passed(item)]
    assert passed[0] == pytest.approx(9.0 - LEAD_IN, abs=0.011)
    assert passed == pytest.approx(list(np.arange(passed[0], 9.995, 0.01)), abs=1e-6)


LIMITS = ReadingLimits(weight=4.0, angular_speed=DRIVE.angular_speed, feed_speed=DRIVE.feed_speed)


def reading_at(t: float) -> AxisReading:
    return reading(*DRIVE.positions(t), *DRIVE.speeds(t))


def test_planned_run_is_never_refused_not_even_with_gaps() -> None:
    before = None
    for k in (0, 1, 2, 3, 1000, 1001, 1500, 5000):
        t = 1.0e-3 * k
        assert LIMITS.against_motion(t, reading_at(t), before) == ""
        before = (t, reading_at(t))


def test_speed_beyond_the_limit_is_named_with_it() -> None:
    fast = replace(reading_at(2.0), angular_speed=10.0)
    assert LIMITS.against_motion(2.0, fast, None) == (
        "cylinder must not be faster than 5.22, got 10"
    )


def test_jump_of_either_axis_is_refused() -> None:
    before = (2.0, reading_at(2.0))
    for field, name in (("cylinder_angle", "cylinder"), ("carriage_position", "carriage")):
        jumped = replace(reading_at(2.001), **{field: 5.0})
        assert LIMITS.against_motion(2.001, jumped, before).startswith(f"{name} jumped by ")


def test_tension_beyond_five_weights_is_refused() -> None:
    assert LIMITS.against_tension(19.9) == ""
    assert LIMITS.against_tension(20.1) == "tension must be at most 20 N, got 20.1 N"
