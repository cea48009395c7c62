"""The controller and its estimate of the lay: modes, fall-backs, bounds, and no step in any."""

import math

import numpy as np
import pytest
from axis_readings import axis_reading
from even_helix import EvenHelix

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import GuideLaw, WantedProgram
from lay_control_node.control.lay_controller import ControllerConfig, LayController, Setpoint
from lay_control_node.control.lay_filter import LayFilter, LayFilterConfig
from lay_control_node.control.stretch_filter import StretchFilter
from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.cable.condition import Condition, ResolvedCondition, published_case
from winding_core.cable.material_law import MaterialLaw
from winding_core.lay.program import LayProgram
from winding_core.lay.records import LAY_DTYPE, ControlBasis, ControlMode, LayFlag
from winding_core.machine.commanded_axis import MotionLimits
from winding_core.machine.commands import CARRIAGE
from winding_core.markers import MARKER_DTYPE

CASE = published_case(4, "case")
RADIUS = CASE.centreline_radius
OMEGA, FEED = 1.74, 5.0e-3
ADVANCE = FEED / OMEGA
PERIOD = 0.02


def controller(*, patience: float = math.inf) -> LayController:
    """Return a controller of case 4 that drives the guide."""
    law = LayOnLaw(CASE, MaterialLaw(law="neo_hookean"))
    return LayController(
        config=ControllerConfig(
            advance_per_radian=ADVANCE,
            bending_stiffness=1.0e-9,
            guide=MotionLimits(name=CARRIAGE, low=-0.1, high=1.0, speed=0.08, acceleration=0.5),
            solver_patience=patience,
        ),
        wanted=EvenHelix(ADVANCE),
        law=GuideLaw(radius=RADIUS),
        lay=LayFilter(LayFilterConfig(radius=RADIUS, free_length=0.198)),
        stretch=StretchFilter(law, spacing=CASE.marker_spacing, radius=RADIUS),
        mode=ControlMode.DRIVE,
    )


class Machine:
    """A carriage that follows its command, and a cable that follows over a true length [m]."""

    def __init__(self, control: LayController, length: float) -> None:
        self.control, self.length = control, length
        self.t = self.guide = self.speed = self.theta = self.z = 0.0
        self.lay: list[tuple[float, float]] = [(0.0, 0.0)]
        self.setpoints: list[Setpoint] = []

    def wind(self, duration: float, *, seen: bool = True, solved: bool = True) -> None:
        """Wind for a time [s], with or without tracker and solver."""
        for _ in range(round(duration / PERIOD)):
            self.t += PERIOD
            omega = OMEGA * min(self.t, 1.0)
            turned = omega * PERIOD
            kept = math.exp(-turned * RADIUS / self.length)
            self.z = self.guide + (self.z - self.guide) * kept
            self.theta += turned
            self.lay.append((self.theta, self.z))
            if seen:
                self.control.take_lay(self._places())
            if solved:
                self.control.take_solver(self.t)
            reading = axis_reading(self.theta, self.guide, speed=omega, feed=self.speed)
            setpoint = self.control.advance(self.t, reading, CASE.weight)
            self.setpoints.append(setpoint)
            self.guide, self.speed = setpoint.guide, setpoint.guide_speed

    def error(self) -> float:
        """Return what the cable lies before its wanted place at the contact line [m]."""
        return self.z - ADVANCE * self.theta

    def _places(self) -> np.ndarray:
        theta, z = np.array(self.lay).T
        at = np.arange(0.0873, self.theta - 0.1, 0.0873)
        places = np.zeros(at.size, dtype=LAY_DTYPE)
        places["theta"], places["z"] = at, np.interp(at, theta, z)
        places["sigma_z"] = 3.0e-5
        return places


def winding(length: float, duration: float, control: LayController | None = None) -> Machine:
    """Return a machine with a true free length [m] that has wound for a time [s]."""
    machine = Machine(control or controller(), length)
    machine.wind(duration)
    return machine


@pytest.mark.parametrize("length", [0.16, 0.198, 0.23])
def test_the_cable_lands_on_the_helix_whatever_the_free_length(length: float) -> None:
    machine = winding(length, 6.0)
    # Two of the 0.03 mm that heights are known by.
    assert abs(machine.error()) < 6.0e-5


def test_without_a_tracker_it_goes_on_by_what_it_knows() -> None:
    machine = winding(0.17, 6.0)
    before = len(machine.setpoints)
    machine.wind(8.0, seen=False)
    steps = np.diff([s.guide for s in machine.setpoints[before - 2 :]])
    assert machine.setpoints[-1].basis is ControlBasis.MODEL
    # What the feed makes in a period, and a tenth of a millimetre.
    assert np.abs(steps).max() < FEED * PERIOD + 1.0e-4
    assert abs(machine.error()) < 1.0e-3


def test_without_a_solver_the_guide_follows_the_drive_programme() -> None:
    machine = winding(0.17, 6.0, controller(patience=1.0))
    before = len(machine.setpoints)
    machine.wind(4.0, solved=False)
    speeds = [s.guide_speed for s in machine.setpoints[before:]]
    steps = np.diff([s.guide for s in machine.setpoints[before - 1 :]])
    assert machine.setpoints[-1].basis is ControlBasis.RAMP
    assert speeds[-1] == pytest.approx(FEED)
    assert np.abs(steps).max() < FEED * PERIOD + 1.0e-4


def test_taking_over_in_mid_run_makes_no_step() -> None:
    control = controller()
    control.mode = ControlMode.WATCH
    machine = Machine(control, 0.17)
    for _ in range(300):
        machine.wind(PERIOD)
        machine.guide, machine.speed = FEED * max(machine.t - 0.5, 0.0), FEED
    control.mode = ControlMode.DRIVE
    # 15 mm are made up at 2.5 mm per radian, which the carriage can; the rest dies out after that.
    machine.wind(12.0)
    speeds = np.array([s.guide_speed for s in machine.setpoints[299:]])
    assert np.abs(np.diff(speeds)).max() <= 0.5 * PERIOD * (1.0 + 1.0e-9)
    assert abs(machine.error()) < 1.0e-4


def test_setpoint_waits_for_a_carriage_that_stands_and_goes_on_with_it() -> None:
    machine = winding(0.198, 6.0)
    stood = machine.guide
    for _ in range(400):
        machine.wind(PERIOD)
        machine.guide, machine.speed = stood, 0.0
    # The default following error, and what the carriage's own speed takes to brake.
    assert machine.setpoints[-1].ahead == pytest.approx(0.02, abs=1.0e-3)
    assert machine.setpoints[-1].limited
    machine.wind(20.0)
    assert abs(machine.error()) < 1.0e-4


def test_no_pull_is_commanded_without_a_brake() -> None:
    machine = winding(0.198, 1.0)
    assert machine.setpoints
    assert all(s.pull is None for s in machine.setpoints)


def test_the_pull_follows_the_program_where_a_brake_gives_it() -> None:
    what = Condition(case=4, law="neo_hookean").resolved()
    weight = what.case.weight
    theta = np.arange(4.0)
    # Stated twice, above what the brake may give, and left to the weight.
    tension = np.array([0.8 * weight, math.nan, 9.0 * weight, 0.8 * weight])
    program = LayProgram(theta=theta, z=ADVANCE * theta, tension=tension)
    control = ControlParameters()
    wanted = WantedProgram.of(program, what, control.limits(what))
    for brake in (True, False):
        controller = control.controller(
            what, wanted, markers={}, mode=ControlMode.DRIVE, brake=brake
        )
        pulls = []
        for k, angle in enumerate((0.5, 1.5, 2.5)):
            reading = axis_reading(angle, speed=OMEGA)
            pulls.append(controller.advance(0.1 * k, reading, weight).pull)
        shares = [0.8, 1.0, control.pull_range[1]]
        assert pulls == ([share * weight for share in shares] if brake else [None] * 3)


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
        reading = axis_reading(theta, guide, speed=omega, feed=speed)
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


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_commands_stay_within_bounds_whatever_is_wanted_and_whatever_fails(seed: int) -> None:
    check(seed)


@pytest.mark.campaign
@pytest.mark.timeout(600)
@pytest.mark.parametrize("first", range(100, 1100, 50))
def test_a_thousand_programs_and_faults_stay_within_bounds(first: int) -> None:
    for seed in range(first, first + 50):
        check(seed)
