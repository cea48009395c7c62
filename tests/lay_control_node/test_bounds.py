"""No program, no rig and no fault makes the controller command beyond its bounds."""

import math

import numpy as np
import pytest

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import WantedProgram
from lay_control_node.control.lay_controller import LayController, Setpoint
from winding_core.condition import Condition, ResolvedCondition
from winding_core.lay_control_records import ControlMode
from winding_core.lay_program import LayProgram
from winding_core.lay_records import LAY_DTYPE, LayFlag
from winding_core.markers import MARKER_DTYPE
from winding_core.readings import AxisReading

PERIOD = 0.02
ROUNDING = 1.0e-9


def any_program(rng: np.random.Generator) -> LayProgram:
    """Return straight pieces of any slope, dwells and reversals among them."""
    theta = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 8.0, int(rng.integers(1, 7))))])
    slopes = rng.choice([0.0, 1.0, -1.0], theta.size - 1) * 10.0 ** rng.uniform(
        -4.0, -1.5, theta.size - 1
    )
    slopes[0] = abs(slopes[0])
    z = np.concatenate([[0.0], np.cumsum(slopes * np.diff(theta))])
    return LayProgram(name="any", theta=theta, z=z, tension=np.full(theta.size, math.nan))


def any_control(rng: np.random.Generator) -> ControlParameters:
    low = rng.uniform(0.05, 0.9)
    return ControlParameters(
        control_gain=10.0 ** rng.uniform(-1.0, 0.69),
        guide_speed_limit=10.0 ** rng.uniform(-3.0, 0.0),
        guide_acceleration_limit=10.0 ** rng.uniform(-1.5, 1.0),
        guide_travel=[rng.uniform(-0.3, -0.001), rng.uniform(0.02, 1.0)],
        pull_range=[low, low * rng.uniform(1.1, 8.0)],
    )


def places(theta: float, guide: float, rng: np.random.Generator) -> np.ndarray:
    """Return measured places, right, wrong by up to a metre, not finite, flagged, out of order."""
    found = np.zeros(int(rng.integers(0, 6)), dtype=LAY_DTYPE)
    found["theta"] = rng.uniform(min(theta, 0.0) - 1.0, max(theta, 0.0) + 1.0, found.size)
    found["z"] = guide + rng.choice([1.0e-3, 0.03, 1.0, math.inf, math.nan], found.size)
    found["sigma_z"] = rng.choice([0.0, 3.0e-5, 1.0e-3, math.nan], found.size)
    found["flags"] = rng.choice([0, int(LayFlag.OVERLAP), int(LayFlag.CLIMB)], found.size)
    return found


def markers(theta: float, guide: float, rng: np.random.Generator) -> np.ndarray:
    found = np.zeros(int(rng.integers(0, 3)), dtype=MARKER_DTYPE)
    found["id"] = rng.integers(0, 6, found.size)
    found["theta"] = theta - rng.uniform(0.0, 1.0, found.size)
    found["z"] = guide + rng.choice([1.0e-3, 0.1, math.nan], found.size)
    found["sigma_theta"], found["sigma_z"] = 3.0e-3, 1.0e-4
    return found


def wound(seed: int) -> tuple[ControlParameters, ResolvedCondition, list[Setpoint]]:
    """Wind any program with any faults; return what was commanded while it drove."""
    rng = np.random.default_rng(seed)
    what = Condition(case=int(rng.integers(1, 13)), law="neo_hookean").resolved()
    control = any_control(rng)
    wanted = WantedProgram.of(any_program(rng), what, control.limits(what))
    aims = {n: float(rng.uniform(1.0, 9.0) * n) for n in range(1, 5)} if seed % 2 else {}
    controller: LayController = control.controller(
        what, wanted, markers=aims, mode=ControlMode.DRIVE, solver_patience=0.5
    )
    t = theta = guide = speed = 0.0
    omega, pull = 0.0, what.case.weight
    setpoints = []
    for _ in range(400):
        t += PERIOD
        if rng.random() < 0.02:
            omega = float(rng.choice([0.0, 0.5, 1.74, 6.0, -0.5]))
        theta += omega * PERIOD
        if rng.random() < 0.01:
            pull = what.case.weight * float(rng.choice([0.0, 0.2, 1.0, 5.0]))
        if rng.random() < 0.3:
            controller.take_lay(places(theta, guide, rng))
        if rng.random() < 0.3:
            controller.take_markers(markers(theta, guide, rng))
        if rng.random() < 0.9:
            controller.take_solver(t)
        reading = AxisReading(
            cylinder_angle=theta, angular_speed=omega, carriage_position=guide, feed_speed=speed
        )
        setpoint = controller.advance(t, reading, pull)
        setpoints.append(setpoint)
        # A driver that does not follow for once leaves the carriage where it is.
        if rng.random() < 0.95:
            guide, speed = setpoint.guide, setpoint.guide_speed
    return control, what, setpoints


def check(seed: int) -> None:
    control, what, setpoints = wound(seed)
    guide = np.array([s.guide for s in setpoints])
    speed = np.array([s.guide_speed for s in setpoints])
    low, high = control.guide_travel
    assert guide.min() >= low - ROUNDING
    assert guide.max() <= high + ROUNDING
    assert np.abs(speed).max() <= control.guide_speed_limit + ROUNDING
    assert np.abs(np.diff(guide)).max() <= control.guide_speed_limit * PERIOD + ROUNDING
    most = control.guide_acceleration_limit * PERIOD
    assert np.abs(np.diff(speed)).max() <= most * (1.0 + 1.0e-6)
    pulls = np.array([s.pull for s in setpoints if s.pull is not None]) / what.case.weight
    assert np.isfinite(pulls).all()
    if pulls.size:
        assert pulls.min() >= control.pull_range[0] - ROUNDING
        assert pulls.max() <= control.pull_range[1] + ROUNDING


@pytest.mark.parametrize("seed", range(8))
def test_commands_stay_within_bounds_whatever_is_wanted_and_whatever_fails(seed):
    check(seed)


@pytest.mark.campaign
@pytest.mark.timeout(3000)
def test_a_thousand_programs_and_faults_stay_within_bounds():
    for seed in range(100, 1100):
        check(seed)
