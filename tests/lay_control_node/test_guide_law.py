"""The guide: wherever the cable lies it comes back to the wanted line, within every bound."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lay_control_node.control.guide_law import BoundedMotion, GuideLaw, WantedPoint
from lay_control_node.control.lay_filter import LayEstimate
from winding_core.machine.commanded_axis import MotionLimits
from winding_core.machine.commands import CARRIAGE

Array = NDArray[np.float64]

RADIUS, LENGTH, BEND = 0.032, 0.198, 0.01
PITCH = 2.87e-3


def believed_lay(**own: float) -> LayEstimate:
    lay = {"free_length": LENGTH, "bend_length": BEND, "offset": 0.0, **own}
    return LayEstimate(covariance=np.eye(4), **lay)


def wound(
    angle: float, law: GuideLaw, *, believed: float = LENGTH, start: float = 0.0, bend: float = BEND
) -> Array:
    """Wind an angle [rad] of an even helix from an error [m] on, the span pointing along it.

    Returns:
        Columns theta [rad], error of z [m], z' [m/rad], guide's rate [m/rad]; shape (n, 4).
    """
    far, near = (LENGTH - bend) / RADIUS, bend / RADIUS
    z, headed, step = start, start + near * PITCH, 1.0e-3
    guide = headed + far * PITCH
    rows = []
    for theta in np.arange(0.0, angle, step):
        lay = believed_lay(theta=theta, z=z, headed=headed, free_length=believed, bend_length=bend)
        wanted = WantedPoint(z=PITCH * theta, slope=PITCH, curvature=0.0)
        command = law.command(wanted, lay, guide, step)
        rows.append((theta, PITCH * theta - z, (headed - z) / near, command.per_radian))
        z, headed = z + (headed - z) / near * step, headed + (guide - headed) / far * step
        guide = command.position
    return np.array(rows)


@pytest.mark.parametrize("bend", [2.0e-3, 1.0e-2, 2.0e-2])
def test_an_error_dies_out_whatever_the_cable_is_bent_over(bend: float) -> None:
    gain, near = 1.0, bend / RADIUS
    rows = wound(6.0, GuideLaw(radius=RADIUS, gain=gain), start=-2.0e-3, bend=bend)
    # E = v - h obeys E'' + 4 k E' + 4 k^2 E = 0 with E' = 0 first, and the error of z follows by
    # t2 e' = E - e. One in a hundred of the first error is left to Euler's steps.
    theta, step = rows[:, 0], rows[1, 0]
    headed = 2.0e-3 * (1.0 + 2.0 * gain * theta) * np.exp(-2.0 * gain * theta)
    exact = [2.0e-3]
    for value in headed[:-1]:
        exact.append(exact[-1] + (value - exact[-1]) / near * step)
    assert rows[:, 1] == pytest.approx(np.array(exact), abs=0.02e-3)
    assert abs(rows[-1, 1]) < 0.01 * 2.0e-3


@pytest.mark.parametrize("ratio", [0.7, 1.4])
def test_a_wrong_free_length_leaves_a_steady_error(ratio: float) -> None:
    """On the helix w' = w'/q + 4 k t1 (w' + k e - w'/q), q the ratio of believed to true t1."""
    rows = wound(30.0, GuideLaw(radius=RADIUS, gain=1.0), believed=ratio * LENGTH)
    q = (ratio * LENGTH - BEND) / (LENGTH - BEND)
    far = (ratio * LENGTH - BEND) / RADIUS
    exact = (1.0 - q) * PITCH / q * (1.0 - 1.0 / (4.0 * far))
    assert rows[-1, 1] == pytest.approx(exact, rel=1.0e-3)


@pytest.mark.parametrize("missing", [1.0e-3, 2.0e-2, 0.2])
def test_laid_cable_is_never_curved_beyond_what_friction_holds(missing: float) -> None:
    turning = 0.1 * RADIUS
    rows = wound(40.0, GuideLaw(radius=RADIUS, turning=turning), start=-missing)
    curvature = np.diff(rows[:, 2]) / np.diff(rows[:, 0])
    # One step of the lag's integration beside the bound.
    assert np.abs(curvature).max() <= 1.01 * turning
    assert abs(rows[-1, 1]) < 1.0e-5


@pytest.mark.parametrize("missing", [1.0e-3, 2.0e-2, 0.2])
def test_a_large_error_is_made_up_without_overshoot(missing: float) -> None:
    rows = wound(40.0, GuideLaw(radius=RADIUS, turning=0.1 * RADIUS), start=-missing)
    assert rows[:, 1].min() > -0.02 * missing


def test_a_guide_goes_on_as_it_stands_whatever_the_estimate() -> None:
    """A cable that is believed elsewhere changes the rate, never the place."""
    law = GuideLaw(radius=RADIUS, turning=0.1 * RADIUS)
    lay = believed_lay(theta=1.0, z=0.05, headed=0.05, offset=1.0e-4)
    wanted = WantedPoint(z=1.0e-3, slope=2.0e-3, curvature=0.0)
    assert law.command(wanted, lay, 0.02, 0.0).position == 0.02
    assert law.command(wanted, lay, 0.02, 1.0e-6).position == pytest.approx(0.02, abs=1.0e-7)


def test_the_guide_of_a_lay_that_is_right_leads_by_the_lag() -> None:
    rows = wound(5.0, GuideLaw(radius=RADIUS, turning=0.1 * RADIUS))
    assert rows[:, 1] == pytest.approx(0.0, abs=1.0e-9)
    assert rows[:, 3] == pytest.approx(PITCH, rel=1.0e-6)


BOUNDS = MotionLimits(name=CARRIAGE, low=-0.1, high=0.4, speed=0.08, acceleration=0.5)
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
