"""The estimate of the lay: the law of the lag, and heights that are used or refused."""

import math

import numpy as np
import pytest

from lay_control_node.control.lay_filter import LayFilter, LayFilterConfig, Place
from winding_core.helix import FleetAngleLaw

RHO, BELIEVED = 0.032, 0.198
RISE = 2.87e-3


def filtered(length: float, *, delay: float, sigma: float, until: float) -> LayFilter:
    """Wind under an even feed over a span of a length [m]; heights come a delay [rad] late."""
    law = FleetAngleLaw(advance_per_radian=RISE, free_length=length, radius=RHO)
    rng = np.random.default_rng(5)
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    seen = 0.0
    for theta in np.arange(0.0, until, 0.01):
        lay.advance(Place(float(theta), RISE * float(theta)))
        if theta - delay > seen + 0.0873:
            seen = float(theta - delay)
            lay.measure(seen, float(law.z(seen)) + sigma * rng.standard_normal(), sigma)
    return lay


def test_without_a_measurement_it_is_the_law_of_the_lag() -> None:
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    law = FleetAngleLaw(advance_per_radian=RISE, free_length=BELIEVED, radius=RHO)
    for theta in np.arange(0.0, 20.0, 0.01):
        lay.advance(Place(float(theta), RISE * float(theta)))
    now = lay.estimate()
    # The bent end counts as half a millimetre long at least, which is left out of the law.
    assert now.z == pytest.approx(float(law.z(now.theta)), abs=2.0 * 5.0e-4 * RISE / RHO)


@pytest.mark.parametrize("bend", [0.002, 0.01, 0.02])
def test_a_bent_span_is_two_lags_in_a_row(bend: float) -> None:
    """A lag of L - l and one of l under an even feed, against the sum of their exponentials."""
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    for theta in np.arange(0.01, 8.0, 0.01):
        lay.advance(Place(float(theta), RISE * float(theta), bend))
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


def test_a_span_that_the_guide_reports_longer_is_followed_unseen() -> None:
    """z' = (g - z) / (L / rho) with L that grows by 30 % within three turns, in small steps."""
    step, z = 1.0e-3, 0.0
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    unaware = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    for k in range(1, round(6.0 * math.pi / step)):
        theta = step * k
        longer = 0.3 * BELIEVED * min(theta / (4.0 * math.pi), 1.0)
        z += (RISE * (theta - 0.5 * step) - z) * RHO / (BELIEVED + longer) * step
        if k % 20 == 0:
            lay.advance(Place(theta, RISE * theta, longer=longer))
            unaware.advance(Place(theta, RISE * theta))
    # The bent end counts as half a millimetre long at least, which is left out of the law.
    assert lay.estimate().z == pytest.approx(z, abs=2.0 * 5.0e-4 * RISE / RHO)
    assert lay.estimate().free_length == pytest.approx(1.3 * BELIEVED)
    assert abs(unaware.estimate().z - z) > 2.0e-3


@pytest.mark.parametrize("held", [1.0, 0.0])
def test_what_a_neighbour_holds_is_no_offset_of_the_eye(held: float) -> None:
    """The guide stands 3 mm nearer to the turn before than the cable that lies against it."""
    lay = LayFilter(LayFilterConfig(radius=RHO, free_length=BELIEVED))
    for theta in np.arange(0.01, 6.0, 0.01):
        lay.advance(Place(float(theta), -3.0e-3))
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
        lay.advance(Place(theta, RISE * theta))
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
        lay.advance(Place(before.theta, float(guide)))
        lay.advance(Place(before.theta - 0.5, float(guide)))
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
def test_deviations_cover_the_errors() -> None:
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
            lay.advance(Place(float(theta), RISE * float(theta)))
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
        lay.advance(Place(float(theta), RISE * float(theta)))
        place = float(theta) - 0.3
        due = place > lay.measured_to + 0.0873
        if due and lay.measure(place, float(law.z(place)) + 0.02, 5.0e-5) is not None:
            believed = min(believed, place)
    # Places come every 0.09 rad.
    assert believed == pytest.approx(first + math.pi, abs=0.2)
    now = lay.estimate()
    # Between two places the lag takes the cable back; the heights say otherwise: a tenth is left.
    assert now.z == pytest.approx(float(law.z(now.theta)) + 0.02, abs=2.0e-3)
