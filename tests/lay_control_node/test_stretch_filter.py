"""What the landing of markers tells of the tension at lay-on."""

from __future__ import annotations

import numpy as np
import pytest

from lay_control_node.control.stretch_filter import StretchFilter, StretchFilterConfig
from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.condition import published_case
from winding_core.material_law import MaterialLaw

CASE = published_case(4, "case")
LAW = LayOnLaw(
    CASE,
    MaterialLaw(law="neo_hookean", young=CASE.material.young, poisson=CASE.material.poisson),
)
SLOPE, BUILD_UP = 2.87e-3, 0.255
STEP = 0.02


def wound(
    pulls: np.ndarray, *, share: float, drag: float, start: float, config: StretchFilterConfig
) -> tuple[StretchFilter, np.ndarray]:
    """Wind under pulls [N], one per step of 0.02 rad; return the filter and landing angles."""
    found = StretchFilter(
        LAW,
        spacing=CASE.marker_spacing,
        radius=CASE.centreline_radius,
        config=config,
    )
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


def test_lay_on_density_and_tension_are_inverse() -> None:
    for force in (0.5, 1.0, 3.0, 6.0):
        density = float(LAW.density(force, SLOPE))
        # Two linear interpolations in a table of 800 stretches.
        assert LAW.force_for(density, SLOPE) == pytest.approx(force, rel=2.0e-3)


def test_lay_on_agrees_with_the_quasi_static_lay() -> None:
    """Same closed form as `QuasiStaticLay`, for the angle of the markers under the weight."""
    from winding_core.quasi_static import QuasiStaticLay
    from winding_core.tension import DeadWeight

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
    found = StretchFilter(
        LAW,
        spacing=CASE.marker_spacing,
        radius=CASE.centreline_radius,
        config=config,
    )
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
    for angle in np.arange(found.landed_at, found.landed_at + 4.0, STEP):
        found.advance(float(angle), CASE.weight, SLOPE)
    found.land(found.landed + 1, found.landed_at + 3.0, 1.0e-3)
    # Half a turn too early is some fifty deviations; the belief moves by three.
    assert abs(found.estimate.share - before) < 0.2
    assert landing.size == 4
