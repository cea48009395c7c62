"""The pull that brings markers to their places without moving what lies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lay_control_node.control.guide_law import WantedPoint
from lay_control_node.control.landing_law import LandingLaw, PullBounds
from lay_control_node.control.stretch_filter import Progress, StretchEstimate
from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.condition import published_case
from winding_core.material_law import MaterialLaw

CASE = published_case(4, "case")
LAW = LayOnLaw(
    CASE,
    MaterialLaw(law="neo_hookean", young=CASE.material.young, poisson=CASE.material.poisson),
)
PITCH = 2.87e-3
BOUNDS = PullBounds(low=0.3 * CASE.weight, high=1.5 * CASE.weight, per_radian=0.09)
KNOWN = StretchEstimate(
    share=0.7, drag=0.15, start=0.3, build_up_length=0.255, covariance=np.zeros((4, 4))
)


class EvenHelix:
    """An even helix."""

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        return WantedPoint(z=PITCH * theta, slope=PITCH, curvature=0.0)


def laid_lengths(theta: np.ndarray, pulls: np.ndarray) -> np.ndarray:
    """Return the undeformed length at the end of each step of the angle."""
    tension = KNOWN.tension(pulls, CASE.centreline_radius * theta)
    return np.cumsum(LAW.density(tension, PITCH) * np.diff(theta, prepend=0.0))


def wound(markers: dict[int, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wind by the law with a known rig; return angles, pulls and where markers land."""
    law = LandingLaw(
        LAW,
        spacing=CASE.marker_spacing,
        radius=CASE.centreline_radius,
        markers=markers,
        wanted=EvenHelix(),
        bounds=BOUNDS,
    )
    theta = np.arange(0.02, max(markers.values()) + 3.0, 0.02)
    pulls = np.empty(theta.size)
    pull, laid, landed = CASE.weight, 0.0, 0
    for k, angle in enumerate(theta):
        landed = int(laid / CASE.marker_spacing)
        pull = law.pull(
            Progress(theta=float(angle) - 0.02, laid=laid, landed=landed),
            KNOWN,
            pull,
            free=angle < 0.2,
        )
        pulls[k] = pull
        tension = KNOWN.tension(pull, CASE.centreline_radius * angle)
        laid += float(LAW.density(tension, PITCH)) * 0.02
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
    _, _, landed = wound(markers)
    # A hundredth of what 1 % of a turn allows, five steps of 0.02 rad at 1 % of stretch each.
    assert landed == pytest.approx(list(markers.values()), abs=6.0e-3)


def test_unevenly_wanted_markers_are_reached_too() -> None:
    low, high = reachable(0.7), reachable(1.1)
    between = high[2] - low[2]
    markers = {1: low[1], 2: low[2] + 0.3 * between, 3: low[3] + 0.5 * between}
    _, _, landed = wound(markers)
    assert landed == pytest.approx(list(markers.values()), abs=0.02)


def test_the_pull_never_changes_faster_than_friction_holds() -> None:
    markers = reachable(0.6) | {2: 1.03 * reachable(0.6)[2]}
    theta, pulls, _ = wound(markers)
    wound_on = theta > 0.22
    change = np.abs(np.diff(np.log(pulls[wound_on]))) / 0.02
    assert change.max() <= BOUNDS.per_radian * (1.0 + 1.0e-9)
    assert pulls.min() >= BOUNDS.low
    assert pulls.max() <= BOUNDS.high


def test_what_is_out_of_reach_is_missed_by_as_little_as_can_be() -> None:
    markers = {k: 2.0 * math.pi * 1.6 * k for k in range(1, 5)}
    _, pulls, _ = wound(markers)
    assert pulls[20:500] == pytest.approx(BOUNDS.high)


def test_bounds_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="largest pull must exceed the smallest"):
        PullBounds(low=2.0, high=1.0, per_radian=0.1)
