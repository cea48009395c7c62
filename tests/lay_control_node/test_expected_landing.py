"""What is said before a run of where markers will land under control."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.expected_landing import ExpectedLanding, expected_landings
from lay_control_node.control.guide_law import WantedPoint
from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.lay.records import ControlMode

TURN = 2.0 * math.pi
PITCH = 2.87e-3


class EvenHelix:
    """An even helix."""

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        return WantedPoint(z=PITCH * theta, slope=PITCH, curvature=0.0)


def resolved(case: int) -> ResolvedCondition:
    return Condition(case=case, law="neo_hookean").resolved()


def within_reach(control: ControlParameters, what: ResolvedCondition) -> dict[int, float]:
    """Return where markers land [rad] under 0.9 of the weight, if the tension is as believed."""
    controller = control.controller(what, EvenHelix(), markers={1: 1.0}, mode=ControlMode.WATCH)
    assert controller.landing is not None
    theta = np.arange(0.01, 60.0, 0.01)
    tension = controller.stretch.estimate.tension(
        0.9 * what.case.weight, what.case.centreline_radius * theta
    )
    laid = np.cumsum(controller.landing.law.density(tension, PITCH) * 0.01)
    return {
        n: float(np.interp(n * what.case.marker_spacing, laid, theta))
        for n in range(1, what.case.marker_count + 1)
    }


def expected(case: int, **changed: float) -> tuple[ExpectedLanding, ...]:
    control, what = ControlParameters(**changed), resolved(case)
    return expected_landings(control, what, EvenHelix(), within_reach(control, what))


def test_markers_within_reach_are_expected_at_their_places() -> None:
    for item in expected(4):
        # Steps of 0.05 rad, and half of the angle that a change of the pull is worth.
        assert item.expected == pytest.approx(item.wanted, abs=0.01)


def test_what_has_landed_is_learnt_from() -> None:
    sigmas = [item.sigma for item in expected(4)]
    # What a brake's own friction makes of it is learnt by nobody, half of P1's deviation here.
    assert max(sigmas[1:]) < 0.7 * sigmas[0]


def test_a_softer_cable_is_known_less_well() -> None:
    # Cases 1 and 2 differ in the weight: twice the stretch, twice the doubt of it and more.
    stiff, soft = expected(1), expected(2)
    assert soft[0].sigma > 1.5 * stiff[0].sigma


def test_a_pull_at_its_bounds_is_foreseen() -> None:
    # Where P1 of a soft cable is far off, P2 cannot be brought back within one turn: what a
    # derivative says of small deviations is too little.
    item = expected(2)[1]
    assert item.misses > 1.5 * (abs(item.expected - item.wanted) + 2.0 * item.sigma)


def test_a_known_rig_is_known_before() -> None:
    names = ("load_share_sigma", "drag_sigma", "start_share_sigma", "build_up_length_sigma")
    for item in expected(4, **dict.fromkeys(names, 1.0e-3)):
        # A brake's own friction is left: 4 % of a tension that stretches by 8.5 %.
        assert item.sigma < 0.004 * TURN


def test_what_is_beyond_the_pull_is_said_to_be() -> None:
    control, what = ControlParameters(), resolved(4)
    wanted = {n: 1.15 * angle for n, angle in within_reach(control, what).items()}
    for item in expected_landings(control, what, EvenHelix(), wanted):
        assert item.expected < item.wanted - 0.02 * TURN


def test_nothing_is_expected_where_nothing_is_wanted() -> None:
    assert expected_landings(ControlParameters(), resolved(4), EvenHelix(), {}) == ()
