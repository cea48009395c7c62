"""No command leaves travel, speed or acceleration, whatever is wanted."""

from __future__ import annotations

import numpy as np
import pytest

from lay_control_node.control.guide_law import AxisBounds, BoundedMotion

BOUNDS = AxisBounds(low=-0.1, high=0.4, speed=0.08, acceleration=0.5)
PERIOD = 0.02


@pytest.mark.parametrize("seed", range(50))
def test_random_wants_stay_inside_the_bounds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = BoundedMotion(BOUNDS, rng.uniform(-0.1, 0.4), rng.uniform(-0.02, 0.02))
    for _ in range(300):
        before = motion.speed
        if rng.random() < 0.3:
            motion.go(rng.normal(0.0, 0.2), PERIOD)
        else:
            motion.follow(rng.uniform(-1.0, 1.0), rng.normal(0.0, 0.2), PERIOD)
        assert BOUNDS.low <= motion.position <= BOUNDS.high
        assert abs(motion.speed) <= BOUNDS.speed * (1.0 + 1.0e-12)
        assert abs(motion.speed - before) <= BOUNDS.acceleration * PERIOD * (1.0 + 1.0e-9)


def test_what_can_be_followed_is_followed_exactly() -> None:
    motion = BoundedMotion(BOUNDS, 0.0, 0.01)
    for k in range(1, 200):
        motion.follow(0.01 * k * PERIOD, 0.01, PERIOD)
        assert motion.position == pytest.approx(0.01 * k * PERIOD, abs=1.0e-12)
        assert not motion.limited


def test_a_step_is_made_up_without_overshoot() -> None:
    motion = BoundedMotion(BOUNDS, 0.0, 0.0)
    positions = []
    for _ in range(100):
        motion.follow(0.03, 0.0, PERIOD)
        positions.append(motion.position)
    assert positions[-1] == pytest.approx(0.03, abs=1.0e-6)
    # A control step of braking late at the largest speed.
    assert max(positions) <= 0.03 + 0.5 * BOUNDS.acceleration * PERIOD**2


def test_setpoint_waits_for_an_axis_that_stands() -> None:
    motion = BoundedMotion(BOUNDS, 0.0, 0.05)
    for _ in range(200):
        motion.wait_for(0.0, 0.02)
        motion.follow(0.3, 0.05, PERIOD)
        # It brakes where the reach ends, and a control step late.
        braked = BOUNDS.speed**2 / (2.0 * 0.8 * BOUNDS.acceleration)
        assert motion.position <= 0.02 + braked + BOUNDS.speed * PERIOD
    assert motion.limited
    assert motion.position == pytest.approx(0.02, abs=1.0e-3)
    # As soon as the axis moves, so does the setpoint, without a step.
    before = motion.position
    motion.wait_for(0.01, 0.02)
    motion.follow(0.3, 0.05, PERIOD)
    assert 0.0 < motion.position - before <= BOUNDS.acceleration * PERIOD**2


def test_it_stops_before_the_end_of_the_travel() -> None:
    motion = BoundedMotion(BOUNDS, 0.39, 0.08)
    for _ in range(50):
        motion.go(0.08, PERIOD)
    assert motion.position <= BOUNDS.high
    # It creeps up to the end: below a hundredth of the largest speed.
    assert motion.speed < 0.01 * BOUNDS.speed
