"""The controller and its estimate of the lay: modes, fall-backs, bounds, and no step in any."""

import math

import numpy as np
import pytest

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import AxisBounds, GuideLaw, WantedPoint, WantedProgram
from lay_control_node.control.lay_controller import ControllerConfig, LayController, Setpoint
from lay_control_node.control.lay_filter import LayFilter, LayFilterConfig
from lay_control_node.control.stretch_filter import StretchFilter
from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.cable.condition import Condition, ResolvedCondition, published_case
from winding_core.cable.material_law import MaterialLaw
from winding_core.helix import FleetAngleLaw
from winding_core.lay.program import LayProgram
from winding_core.lay.records import LAY_DTYPE, ControlBasis, ControlMode, LayFlag
from winding_core.machine.readings import AxisReading
from winding_core.markers import MARKER_DTYPE

CASE = published_case(4, "case")
RADIUS = CASE.centreline_radius
OMEGA, FEED = 1.74, 5.0e-3
ADVANCE = FEED / OMEGA
PERIOD = 0.02


class EvenHelix:
    """An even helix of the drive programme's pitch."""

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        return WantedPoint(z=ADVANCE * theta, slope=ADVANCE, curvature=0.0)

    def slopes(self, theta: np.ndarray) -> np.ndarray:
        """Return the same slope everywhere."""
        return np.full(theta.shape, ADVANCE)


def controller(*, patience: float = math.inf) -> LayController:
    """Return a controller of case 4 that drives the guide."""
    law = LayOnLaw(CASE, MaterialLaw(law="neo_hookean"))
    return LayController(
        config=ControllerConfig(
            advance_per_radian=ADVANCE,
            bending_stiffness=1.0e-9,
            guide=AxisBounds(low=-0.1, high=1.0, speed=0.08, acceleration=0.5),
            solver_patience=patience,
        ),
        wanted=EvenHelix(),
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
            reading = AxisReading(
                cylinder_angle=self.theta,
                angular_speed=omega,
                carriage_position=self.guide,
                feed_speed=self.speed,
            )
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


RHO, BELIEVED = 0.032, 0.198
RISE = 2.87e-3


def filtered(length: float, *, delay: float, sigma: float, until: float) -> LayFilter:
    """Wind under an even feed over a span of a length [m]; heights come a delay [rad] late."""
    law = FleetAngleLaw(advance_per_radian=RISE, free_length=length, radius=RHO)
    rng = np.random.default_rng(5)
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    seen = 0.0
    for theta in np.arange(0.0, until, 0.01):
        lay.advance(float(theta), RISE * float(theta))
        if theta - delay > seen + 0.0873:
            seen = float(theta - delay)
            lay.measure(seen, float(law.z(seen)) + sigma * rng.standard_normal(), sigma)
    return lay


def test_without_a_measurement_it_is_the_law_of_the_lag() -> None:
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    law = FleetAngleLaw(advance_per_radian=RISE, free_length=BELIEVED, radius=RHO)
    for theta in np.arange(0.0, 20.0, 0.01):
        lay.advance(float(theta), RISE * float(theta))
    now = lay.estimate()
    # The bent end counts as half a millimetre long at least, which is left out of the law.
    assert now.z == pytest.approx(float(law.z(now.theta)), abs=2.0 * 5.0e-4 * RISE / RHO)


@pytest.mark.parametrize("bend", [0.002, 0.01, 0.02])
def test_a_bent_span_is_two_lags_in_a_row(bend: float) -> None:
    """A lag of L - l and one of l under an even feed, against the sum of their exponentials."""
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    for theta in np.arange(0.01, 8.0, 0.01):
        lay.advance(float(theta), RISE * float(theta), bend)
    now = lay.estimate()
    far, near = (BELIEVED - bend) / RHO, bend / RHO
    share = far / (far - near)
    expected = RISE * (
        now.theta
        - far
        - near
        + share * far * math.exp(-now.theta / far)
        + (1.0 - share) * near * math.exp(-now.theta / near)
    )
    # The guide is taken at the middle of a step: second order in its 0.01 rad over the bent end.
    assert now.z == pytest.approx(expected, abs=1.0e-6)


@pytest.mark.parametrize("held", [1.0, 0.0])
def test_what_a_neighbour_holds_is_no_offset_of_the_eye(held: float) -> None:
    """The guide stands 3 mm nearer to the turn before than the cable that lies against it."""
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    for theta in np.arange(0.01, 6.0, 0.01):
        lay.advance(float(theta), -3.0e-3)
        lay.measure(float(theta), 0.0, 5.0e-5, held=held)
    # A deviation of the eye on its carriage; a cable that nothing holds lies so because of it.
    assert (lay.estimate().offset < LayFilterConfig.sigma_offset) == (held > 0.0)


def test_a_free_length_that_misread_heights_have_led_astray_begins_anew() -> None:
    # As behind a guide that overshoots: for half a turn the heights are those of a longer span.
    true, misread = (
        FleetAngleLaw(advance_per_radian=RISE, free_length=length, radius=RHO)
        for length in (BELIEVED, 0.35)
    )
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED, gate=1.0e-3))
    for theta in np.arange(0.0, 16.0, 0.01).tolist():
        lay.advance(theta, RISE * theta)
        law = misread if theta < 5.0 else true
        lay.measure(theta, float(law.z(theta)), 8.0e-5)
    now = lay.estimate()
    # Five deviations of a height, and of the length that it tells.
    assert now.z == pytest.approx(float(true.z(now.theta)), abs=4.0e-4)
    assert now.free_length == pytest.approx(BELIEVED, abs=5.0 * now.sigma_length)
    assert now.sigma_length < 0.005


@pytest.mark.parametrize("length", [0.16, 0.198, 0.23])
def test_heights_tell_the_free_length(length: float) -> None:
    lay = filtered(length, delay=0.3, sigma=5.0e-5, until=12.0)
    now = lay.estimate()
    assert abs(now.free_length - length) < 3.0 * now.sigma_length
    assert now.sigma_length < 0.5 * lay.config.sigma_length


@pytest.mark.parametrize("delay", [0.1, 1.0, 3.0])
def test_delayed_heights_give_where_the_cable_lands_now(delay: float) -> None:
    law = FleetAngleLaw(advance_per_radian=RISE, free_length=0.17, radius=RHO)
    now = filtered(0.17, delay=delay, sigma=5.0e-5, until=15.0).estimate()
    assert abs(now.z - float(law.z(now.theta))) < 3.0 * now.sigma_z
    assert now.sigma_z < 3.0e-4


def test_a_standing_or_backward_cylinder_lays_nothing() -> None:
    lay = filtered(0.198, delay=0.2, sigma=5.0e-5, until=6.0)
    before = lay.estimate()
    for guide in np.linspace(0.0, 0.1, 20):
        lay.advance(before.theta, float(guide))
        lay.advance(before.theta - 0.5, float(guide))
    after = lay.estimate()
    assert (after.z, after.free_length) == (before.z, before.free_length)


def test_a_height_that_was_measured_already_is_not_used_again() -> None:
    lay = filtered(0.198, delay=0.2, sigma=5.0e-5, until=6.0)
    before = lay.estimate()
    assert lay.measure(lay.measured_to, 1.0, 1.0e-4) is None
    assert lay.measure(7.0, 1.0, 1.0e-4) is None
    assert lay.measure(5.99, math.nan, 1.0e-4) is None
    assert lay.estimate().z == before.z


@pytest.mark.slow
def test_deviations_are_honest() -> None:
    """Squared errors over their variances have a mean of one: 60 random spans and eyes."""
    rng = np.random.default_rng(11)
    scores = []
    for _ in range(60):
        length = BELIEVED + 0.02 * rng.standard_normal()
        offset = 3.0e-4 * rng.standard_normal()
        lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
        z, before, seen = 0.0, 0.0, 0.0
        for theta in np.arange(0.01, 8.0, 0.01):
            eye = RISE * (theta - 0.005) + offset
            z = eye + (z - eye) * math.exp(-(theta - before) * RHO / length)
            before = theta
            lay.advance(float(theta), RISE * float(theta))
            if theta > seen + 0.5:
                seen = theta
                lay.measure(float(theta), z + 1.0e-4 * rng.standard_normal(), 1.0e-4)
        now = lay.estimate()
        error = np.array([now.z - z, now.free_length - length, now.offset - offset])
        known = now.covariance[np.ix_((0, 2, 3), (0, 2, 3))]
        scores.append(error @ np.linalg.solve(known, error) / 3.0)
    # Mean of 180 squared normals: one standard deviation is 0.11; drifts make it smaller.
    assert 0.4 < np.mean(scores) < 1.35


def test_the_height_of_another_turn_is_refused() -> None:
    lay = filtered(BELIEVED, delay=0.3, sigma=5.0e-5, until=12.0)
    before = lay.estimate()
    place = lay.measured_to + 0.05
    assert lay.measure(place, before.z - 2.0 * math.pi * RISE, 4.0e-5) is None
    assert lay.estimate().z == pytest.approx(before.z, abs=1.0e-9)
    assert lay.estimate().free_length == pytest.approx(before.free_length, abs=1.0e-9)


def test_heights_that_keep_coming_are_believed_after_half_a_turn() -> None:
    """The cable is moved by 20 mm: the estimate was wrong, not the camera."""
    lay = filtered(BELIEVED, delay=0.3, sigma=5.0e-5, until=12.0)
    law = FleetAngleLaw(advance_per_radian=RISE, free_length=BELIEVED, radius=RHO)
    first, believed = lay.measured_to, math.inf
    for theta in np.arange(12.0, 18.0, 0.01):
        lay.advance(float(theta), RISE * float(theta))
        place = float(theta) - 0.3
        due = place > lay.measured_to + 0.0873
        if due and lay.measure(place, float(law.z(place)) + 0.02, 5.0e-5) is not None:
            believed = min(believed, place)
    # Places come every 0.09 rad.
    assert believed == pytest.approx(first + math.pi, abs=0.2)
    now = lay.estimate()
    # Between two places the lag takes the cable back; the heights say otherwise: a tenth is left.
    assert now.z == pytest.approx(float(law.z(now.theta)) + 0.02, abs=2.0e-3)


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
            reading = AxisReading(
                cylinder_angle=angle, angular_speed=OMEGA, carriage_position=0.0, feed_speed=0.0
            )
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
