"""Tension from landed markers, the pull that lands the next ones, and what is expected before."""

import math

import numpy as np
import pytest
from even_helix import EvenHelix

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.expected_landing import ExpectedLanding, expected_landings
from lay_control_node.control.landing_law import LandingLaw, PullBounds
from lay_control_node.control.stretch_filter import (
    Progress,
    StretchEstimate,
    StretchFilter,
    StretchFilterConfig,
)
from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.cable.condition import Condition, ResolvedCondition, published_case
from winding_core.cable.material_law import MaterialLaw
from winding_core.lay.records import ControlMode

CASE = published_case(4, "case")
LAW = LayOnLaw(
    CASE, MaterialLaw(law="neo_hookean", young=CASE.material.young, poisson=CASE.material.poisson)
)
SLOPE, BUILD_UP = 2.87e-3, 0.255
STEP = 0.02


HELIX = EvenHelix(SLOPE)
SPACED = {"spacing": CASE.marker_spacing, "radius": CASE.centreline_radius}


def wound(
    pulls: np.ndarray, *, share: float, drag: float, start: float, config: StretchFilterConfig
) -> tuple[StretchFilter, np.ndarray]:
    """Wind under pulls [N], one per step of 0.02 rad; return the filter and landing angles."""
    found = StretchFilter(LAW, config=config, **SPACED)
    theta = STEP * np.arange(1, pulls.size + 1)
    grown = 1.0 - (1.0 - start) * np.exp(-CASE.centreline_radius * (theta - 0.01) / BUILD_UP)
    laid = np.cumsum(LAW.density(grown * (share * pulls + drag), SLOPE) * STEP)
    landing = np.interp(CASE.marker_spacing * np.arange(1, 5), laid, theta)
    number = 1
    for angle, pull in zip(theta, pulls, strict=True):
        found.advance(float(angle), float(pull), SLOPE)
        if number <= 4 and angle > landing[number - 1] + 0.2:
            found.land(number, float(landing[number - 1]), 1.0e-3)
            number += 1
    return found, landing


def test_lay_on_agrees_with_the_quasi_static_lay() -> None:
    """Same closed form as `QuasiStaticLay`, for the angle of the markers under the weight."""
    from winding_core.lay.quasi_static import QuasiStaticLay
    from winding_core.machine.tension import DeadWeight

    expected = QuasiStaticLay(CASE, "neo_hookean").theta(DeadWeight())
    steps = np.arange(0.0, 40.0, 0.01)
    lag = 0.198 / CASE.centreline_radius
    slope = -5.0e-3 / 1.74 * np.expm1(-steps / lag)
    laid = np.cumsum(LAW.density(CASE.weight, slope) * 0.01)
    found = np.interp(CASE.marker_spacing * np.arange(1, 5), laid, steps + 0.01)
    # Steps of 0.05 rad there and of 0.01 rad here.
    assert found == pytest.approx(expected, abs=5.0e-3)


@pytest.mark.parametrize(("share", "drag"), [(0.5, 0.0), (0.9, 0.3), (0.72, 0.1)])
def test_landed_markers_tell_the_tension(share: float, drag: float) -> None:
    config = StretchFilterConfig(start=0.3, sigma_start=0.1, sigma_build_up=1.0e-3)
    pulls = np.full(1500, CASE.weight)
    found, _ = wound(pulls, share=share, drag=drag, start=0.25, config=config)
    true = share * CASE.weight + drag
    estimate = found.estimate
    assert float(estimate.tension(CASE.weight, 1.0)) == pytest.approx(
        true * (1.0 - 0.75 * np.exp(-1.0 / BUILD_UP)), rel=0.02
    )


def test_a_missed_marker_makes_the_segment_longer() -> None:
    config = StretchFilterConfig(start=1.0, sigma_start=0.01)
    found = StretchFilter(LAW, config=config, **SPACED)
    theta = STEP * np.arange(1, 900)
    laid = np.cumsum(np.full(theta.size, float(LAW.density(0.8 * CASE.weight, SLOPE)) * STEP))
    second = float(np.interp(2.0 * CASE.marker_spacing, laid, theta))
    for angle in theta:
        found.advance(float(angle), CASE.weight, SLOPE)
    found.land(2, second, 1.0e-3)
    found.land(1, 0.5 * second, 1.0e-3)
    assert found.landed == 2
    assert float(found.estimate.tension(CASE.weight, 10.0)) == pytest.approx(
        0.8 * CASE.weight, rel=0.02
    )


def test_one_wrong_marker_does_not_carry_the_estimate_away() -> None:
    config = StretchFilterConfig(start=1.0, sigma_start=0.01)
    found, landing = wound(
        np.full(1000, CASE.weight), share=0.7, drag=0.15, start=1.0, config=config
    )
    before = found.estimate.share
    for angle in np.arange(landing[3], landing[3] + 4.0, STEP):
        found.advance(float(angle), CASE.weight, SLOPE)
    found.land(found.landed + 1, landing[3] + 3.0, 1.0e-3)
    # Half a turn too early is some fifty deviations; the estimate moves by three.
    assert abs(found.estimate.share - before) < 0.2


BOUNDS = PullBounds(low=0.3 * CASE.weight, high=1.5 * CASE.weight, per_radian=0.09)
KNOWN = StretchEstimate(
    share=0.7, drag=0.15, start=0.3, build_up_length=0.255, covariance=np.zeros((4, 4))
)


def laid_lengths(theta: np.ndarray, pulls: np.ndarray) -> np.ndarray:
    """Return the undeformed length at the end of each step of the angle."""
    tension = KNOWN.tension(pulls, CASE.centreline_radius * theta)
    return np.cumsum(LAW.density(tension, SLOPE) * np.diff(theta, prepend=0.0))


def wound_by_law(markers: dict[int, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wind by the law with a known rig; return angles, pulls and where markers land."""
    law = LandingLaw(LAW, markers=markers, wanted=HELIX, bounds=BOUNDS, **SPACED)
    theta = np.arange(0.02, max(markers.values()) + 3.0, 0.02)
    pulls = np.empty(theta.size)
    pull, laid, landed = CASE.weight, 0.0, 0
    for k, angle in enumerate(theta):
        landed = int(laid / CASE.marker_spacing)
        progress = Progress(theta=float(angle) - 0.02, laid=laid, landed=landed)
        pull = law.pull(progress, KNOWN, pull, free=angle < 0.2)
        pulls[k] = pull
        tension = KNOWN.tension(pull, CASE.centreline_radius * angle)
        laid += float(LAW.density(tension, SLOPE)) * 0.02
    spaced = CASE.marker_spacing * np.arange(1, len(markers) + 1)
    return theta, pulls, np.interp(spaced, laid_lengths(theta, pulls), theta)


def reachable(scale: float) -> dict[int, float]:
    """Return where markers land under a scaled weight."""
    theta = np.arange(0.02, 40.0, 0.02)
    laid = laid_lengths(theta, np.full(theta.size, scale * CASE.weight))
    spaced = CASE.marker_spacing * np.arange(1, 5)
    return dict(enumerate(np.interp(spaced, laid, theta).tolist(), start=1))


@pytest.mark.parametrize("scale", [0.5, 0.8, 1.2])
def test_markers_land_where_they_are_wanted(scale: float) -> None:
    markers = reachable(scale)
    _, _, landed = wound_by_law(markers)
    # A hundredth of what 1 % of a turn allows, five steps of 0.02 rad at 1 % of stretch each.
    assert landed == pytest.approx(list(markers.values()), abs=6.0e-3)


def test_unevenly_wanted_markers_are_reached_too() -> None:
    low, high = reachable(0.7), reachable(1.1)
    between = high[2] - low[2]
    markers = {1: low[1], 2: low[2] + 0.3 * between, 3: low[3] + 0.5 * between}
    _, _, landed = wound_by_law(markers)
    assert landed == pytest.approx(list(markers.values()), abs=0.02)


def test_the_pull_never_changes_faster_than_friction_holds() -> None:
    markers = reachable(0.6) | {2: 1.03 * reachable(0.6)[2]}
    theta, pulls, _ = wound_by_law(markers)
    wound_on = theta > 0.22
    change = np.abs(np.diff(np.log(pulls[wound_on]))) / 0.02
    assert change.max() <= BOUNDS.per_radian * (1.0 + 1.0e-9)
    assert pulls.min() >= BOUNDS.low
    assert pulls.max() <= BOUNDS.high


def test_what_is_out_of_reach_is_missed_by_as_little_as_can_be() -> None:
    markers = {k: 2.0 * math.pi * 1.6 * k for k in range(1, 5)}
    _, pulls, _ = wound_by_law(markers)
    assert pulls[20:500] == pytest.approx(BOUNDS.high)


def test_bounds_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="largest pull must exceed the smallest"):
        PullBounds(low=2.0, high=1.0, per_radian=0.1)


TURN = 2.0 * math.pi


def resolved(case: int) -> ResolvedCondition:
    return Condition(case=case, law="neo_hookean").resolved()


def within_reach(control: ControlParameters, what: ResolvedCondition) -> dict[int, float]:
    """Return where markers land [rad] under 0.9 of the weight, the tension as in the prior."""
    controller = control.controller(what, HELIX, markers={1: 1.0}, mode=ControlMode.WATCH)
    theta = np.arange(0.01, 60.0, 0.01)
    tension = controller.stretch.estimate.tension(
        0.9 * what.case.weight, what.case.centreline_radius * theta
    )
    laid = np.cumsum(controller.landing.law.density(tension, SLOPE) * 0.01)
    return {
        n: float(np.interp(n * what.case.marker_spacing, laid, theta))
        for n in range(1, what.case.marker_count + 1)
    }


def expected(case: int, **changed: float) -> tuple[ExpectedLanding, ...]:
    control, what = ControlParameters(**changed), resolved(case)
    found = expected_landings(control, what, HELIX, within_reach(control, what))
    assert len(found) == what.case.marker_count
    return found


@pytest.mark.slow
def test_markers_within_reach_are_expected_at_their_places() -> None:
    for item in expected(4):
        # Steps of 0.05 rad, and half of the angle that a change of the pull is worth.
        assert item.expected == pytest.approx(item.wanted, abs=0.01)


@pytest.mark.slow
def test_what_has_landed_is_learnt_from() -> None:
    sigmas = [item.sigma for item in expected(4)]
    # What a brake's own friction makes of it is unobservable, half of P1's deviation here.
    assert max(sigmas[1:]) < 0.7 * sigmas[0]


@pytest.mark.slow
def test_a_softer_cable_is_known_less_well() -> None:
    # Cases 1 and 2 differ in the weight: twice the stretch, twice the doubt of it and more.
    stiff, soft = expected(1), expected(2)
    assert soft[0].sigma > 1.5 * stiff[0].sigma


@pytest.mark.slow
def test_a_pull_at_its_bounds_is_foreseen() -> None:
    # Where P1 of a soft cable is far off, P2 cannot be brought back within one turn: what a
    # derivative makes of small deviations is too little.
    item = expected(2)[1]
    assert item.misses > 1.5 * (abs(item.expected - item.wanted) + 2.0 * item.sigma)


@pytest.mark.slow
def test_a_known_rig_is_known_before() -> None:
    names = ("load_share_sigma", "drag_sigma", "start_share_sigma", "build_up_length_sigma")
    for item in expected(4, **dict.fromkeys(names, 1.0e-3)):
        # A brake's own friction is left: 4 % of a tension that stretches by 8.5 %.
        assert item.sigma < 0.004 * TURN


@pytest.mark.slow
def test_what_is_beyond_the_pull_is_expected_to_miss() -> None:
    control, what = ControlParameters(), resolved(4)
    wanted = {n: 1.15 * angle for n, angle in within_reach(control, what).items()}
    found = expected_landings(control, what, HELIX, wanted)
    assert len(found) == len(wanted)
    for item in found:
        assert item.expected < item.wanted - 0.02 * TURN


def test_nothing_is_expected_where_nothing_is_wanted() -> None:
    assert expected_landings(ControlParameters(), resolved(4), HELIX, {}) == ()
