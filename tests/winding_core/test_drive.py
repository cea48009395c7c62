from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from winding_core.machine.drive import DriveProfile

PAPER = DriveProfile()


@pytest.mark.parametrize(
    ("t", "angle", "carriage"),
    [
        (0.0, 0.0, 0.0),
        (0.5, 0.2175, 0.000625),
        (1.0, 0.87, 0.0025),
        (5.0, 7.83, 0.0225),
        (20.0, 33.93, 0.0975),
        (21.0, 35.67, 0.1025),
    ],
)
def test_the_papers_drive_is_where_its_closed_form_says(
    t: float, angle: float, carriage: float
) -> None:
    assert PAPER.positions(t) == pytest.approx((angle, carriage), rel=1e-14, abs=1e-15)


def test_positions_are_the_integral_of_speeds() -> None:
    for t in (0.3, 1.0, 1.7, 20.0):
        for axis in (0, 1):
            way, error = quad(lambda x, axis=axis: PAPER.speeds(x)[axis], 0.0, t, points=[1.0])
            assert PAPER.positions(t)[axis] == pytest.approx(way, abs=10.0 * error + 1e-14)


def test_both_axes_keep_step_from_the_first_instant() -> None:
    for t in (1e-3, 0.4, 1.0, 13.0):
        angle, carriage = PAPER.positions(t)
        assert carriage / angle == pytest.approx(PAPER.advance_per_radian, rel=1e-14)
        speed, feed = PAPER.speeds(t)
        assert feed / speed == pytest.approx(PAPER.advance_per_radian, rel=1e-14)


def test_the_pitch_is_the_papers() -> None:
    # 5 mm/s over 1.74 rad/s for one turn, by hand.
    assert PAPER.pitch == pytest.approx(0.0180551302, rel=1e-8)


def test_speeds_ramp_linearly_and_hold() -> None:
    assert PAPER.speeds(0.25) == pytest.approx((0.435, 0.00125))
    assert PAPER.speeds(1.0) == PAPER.speeds(19.0) == (1.74, 0.005)


def test_nothing_moves_before_the_start() -> None:
    assert PAPER.speeds(-1.0) == (0.0, 0.0)
    assert PAPER.positions(-1.0) == (0.0, 0.0)


def test_time_at_angle_undoes_positions() -> None:
    for t in (0.0, 0.2, 1.0, 1.0001, 18.0):
        assert PAPER.time_at_angle(PAPER.positions(t)[0]) == pytest.approx(t, rel=1e-12, abs=1e-12)


def test_arrays_and_scalars_agree() -> None:
    t = np.array([-1.0, 0.0, 0.5, 1.0, 7.0])
    assert PAPER.fraction(t).tolist() == [PAPER.fraction(x) for x in t]
    assert PAPER.full_speed_time(t).tolist() == [PAPER.full_speed_time(x) for x in t]


def test_without_a_ramp_full_speed_starts_at_once() -> None:
    sudden = DriveProfile(ramp_time=0.0)
    assert sudden.speeds(1e-9) == (1.74, 0.005)
    assert sudden.positions(2.0) == pytest.approx((3.48, 0.01))
    assert sudden.time_at_angle(3.48) == pytest.approx(2.0)


@pytest.mark.parametrize("name", ["angular_speed", "feed_speed", "ramp_time"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_impossible_drive_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"^{name} must"):
        DriveProfile(**{name: value})


@pytest.mark.parametrize("name", ["angular_speed", "ramp_time"])
def test_a_negative_speed_of_the_cylinder_or_ramp_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name} must"):
        DriveProfile(**{name: -1.0})


def test_a_feed_towards_minus_z_mirrors_the_carriage() -> None:
    back = DriveProfile(feed_speed=-PAPER.feed_speed)
    for t in (0.3, 1.0, 7.0):
        assert back.positions(t) == (PAPER.positions(t)[0], -PAPER.positions(t)[1])
        assert back.speeds(t) == (PAPER.speeds(t)[0], -PAPER.speeds(t)[1])


def test_a_cylinder_that_stands_still_is_refused() -> None:
    with pytest.raises(ValueError, match=r"angular_speed must be positive, got 0\.0 rad/s"):
        DriveProfile(angular_speed=0.0)


def test_an_angle_behind_the_start_is_refused() -> None:
    with pytest.raises(ValueError, match="angle must not be negative"):
        PAPER.time_at_angle(-0.1)
