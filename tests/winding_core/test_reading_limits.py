"""What a machine's readings can be."""

from dataclasses import replace

from winding_core.machine.drive import DriveProfile
from winding_core.machine.incoming_readings import ReadingLimits
from winding_core.machine.readings import AxisReading

DRIVE = DriveProfile()
LIMITS = ReadingLimits(weight=4.0, angular_speed=DRIVE.angular_speed, feed_speed=DRIVE.feed_speed)


def reading_at(t: float) -> AxisReading:
    (angle, guide), (speed, feed) = DRIVE.positions(t), DRIVE.speeds(t)
    return AxisReading(
        cylinder_angle=angle, angular_speed=speed, carriage_position=guide, feed_speed=feed
    )


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
