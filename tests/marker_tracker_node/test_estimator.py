"""One least squares over a run's sightings names the configured number that they contradict."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from marker_tracker_node.detection.band import Band, Body, band_centroid
from marker_tracker_node.tracking.estimator.contradictions import Contradiction, explained
from marker_tracker_node.tracking.estimator.correction import correction
from marker_tracker_node.tracking.estimator.numbers import NUMBERS
from marker_tracker_node.tracking.estimator.pictures import band_pictures
from marker_tracker_node.tracking.estimator.problem import LAP, MARKER, Problem, Seen
from marker_tracker_node.tracking.estimator.verdict import judged
from winding_core.machine.drive import DriveProfile
from winding_verification.tracker.drawn_runs import quick, sightings
from winding_verification.tracker.scenes import World, WrongNumber

# A run of five markers from rest, and one that was joined at full speed.
RAMPED = quick(replace(World.drawn(1), rest=0.6))
EVEN = quick(replace(World.drawn(1), rest=-3.0, drive=DriveProfile(ramp_time=0.0)))


def contradicted(seen: Seen) -> tuple[Contradiction, ...]:
    return explained(seen)[0]


def test_derivatives_are_those_of_the_model() -> None:
    problem = Problem(sightings(RAMPED, (), 5))
    rng = np.random.default_rng(0)
    x = problem.start.copy()
    x[: len(NUMBERS)] = [0.3 * number.doubt * rng.normal() for number in NUMBERS]
    _, slopes = problem.linearised(x)
    for k in range(x.size):
        # Short enough that a reading between two samples of the encoder stays between them.
        step = np.where(np.arange(x.size) == k, 1.0e-6, 0.0)
        after, before = problem.linearised(x + step)[0], problem.linearised(x - step)[0]
        slope = (before - after) / 2.0e-6
        # The centre of a band follows one of its points within a hundredth; the speed between
        # two frames of a ramp is known to half a step of 50 ms, 0.04 of 1.74 rad/s.
        scale = np.abs(slope).max()
        np.testing.assert_allclose(slopes[:, :, k], slope, atol=0.04 * scale + 1.0e-9)


def with_radius(body: Body, r: float) -> Body:
    return body._replace(rho=body.rho - body.cable_radius + r, cable_radius=r)


def test_a_band_that_was_cut_off_for_a_thicker_cable_is_whole_with_its_own() -> None:
    view, body = RAMPED.pinhole().view(RAMPED.config().pose), RAMPED.config().body
    r = body.cable_radius
    thick, touching = with_radius(body, 1.08 * r), 2.0 * r
    # Turns that touch overlap if they are configured thicker, and the gate ends where they meet.
    band = Band(0.3, 0.02, 1.0e-3, low=-math.asin(touching / (2.16 * r)), below=touching)
    seen = band_pictures(view, thick, body, np.array([band]))[0, 0]
    whole = band_centroid(view, body, band._replace(low=-math.pi))[:2]
    np.testing.assert_allclose(seen, whole, atol=1.0e-12)


def test_turns_that_come_to_touch_as_the_cable_grows_move_no_band_by_a_jump() -> None:
    view, body = RAMPED.pinhole().view(RAMPED.config().pose), RAMPED.config().body
    r = body.cable_radius
    bands = np.array([Band(0.3, z, 1.0e-3, below=2.0 * r, above=2.0 * r) for z in (0.0, 0.09)])
    radii = r * np.linspace(0.97, 1.03, 61)
    pictures = [band_pictures(view, body, with_radius(body, one), bands)[:, 0] for one in radii]
    steps = np.abs(np.diff(pictures, axis=0))
    # A cut begins as the root of what overlaps: a thousandth of the radius cuts 0.04 rad off, which
    # is a thousandth of the radius in the picture, seen from twenty of the distance.
    assert steps.max() < 2.0 * 1.0e-3 * r / view.x


@pytest.mark.parametrize(
    ("number", "size"),
    [
        ("encoder_scale", -0.02), ("frame_times", 0.06), ("camera_clock", -0.1),
        ("camera_distance", 0.025), ("camera_along", 0.02), ("camera_roll", -0.06),
        ("focal_length", 0.08), ("focal_length", -0.01), ("cylinder_diameter", -0.03),
        ("cable_diameter", 0.3),
    ],
)  # fmt: skip
def test_the_wrong_number_is_named_with_its_size_and_taken_out(number: str, size: float) -> None:
    seen = sightings(RAMPED, (WrongNumber(number=number, size=size),), 7)
    found, mended = explained(seen)
    assert found
    assert number in found[0].names, found[0].sentence
    if not math.isnan(found[0].share) and found[0].number == number:
        assert abs(found[0].share - size) < 4.0 * found[0].sigma
    if number == "camera_clock":
        return
    theta, z = RAMPED.markers
    # Three deviations, and what noise of 0.07 px leaves of a mean.
    sigma = np.sqrt(mended.doubt) + np.array([[3.0e-4], [2.0e-5]])
    away = np.abs([mended.theta - theta[mended.markers], mended.z - z[mended.markers]])
    assert (away < 3.0 * sigma).all()


def test_an_estimate_that_is_no_longer_carried_is_taken_back() -> None:
    problem = Problem(sightings(RAMPED, (), 5))
    found = correction(problem, judged(problem), made=True)
    assert not found.carried
    assert not found.errors.any()
    assert not found.doubt.any()


@pytest.mark.parametrize(
    "wrong",
    [
        {"camera_tilt_x": 0.012},
        {"camera_roll": -0.008},
        {"focal_length": 0.01},
        {"camera_height": 0.003, "camera_along": -0.003},
        {"camera_distance": -0.004, "camera_tilt_x": 0.008},
        {"cylinder_diameter": 0.08, "camera_tilt_y": 0.008},
    ],
)
def test_numbers_within_doubt_are_named_with_what_explains_as_well(wrong: dict[str, float]) -> None:
    numbers = tuple(WrongNumber(number=name, size=size) for name, size in wrong.items())
    found = contradicted(sightings(RAMPED, numbers, 7))
    assert len(found) == len(wrong)
    for one in numbers:
        assert any(one.names & item.names for item in found), found
    assert found[-1].doubted


@pytest.mark.parametrize("seed", range(20))
def test_a_right_configuration_is_neither_contradicted_nor_corrected(seed: int) -> None:
    assert explained(sightings(quick(World.drawn(100 + seed)), (), seed)) == ((), None)


def test_what_no_number_explains_alone_counts_in_the_deviations() -> None:
    found, mended = explained(
        sightings(RAMPED, (WrongNumber(number="cylinder_diameter", size=0.01),), 7)
    )
    assert found == ()
    assert not mended.carried
    assert not mended.errors.any()
    # Errors of camera and cylinder within their doubts would move the last marker by 0.1 mm.
    assert np.sqrt(mended.doubt[1, -1]) > 5.0e-5


def test_at_constant_speed_scale_and_times_are_named_together() -> None:
    (found,) = contradicted(sightings(EVEN, (WrongNumber(number="encoder_scale", size=0.02),), 3))
    assert {"encoder_scale", "frame_times"} <= found.names


def test_at_constant_speed_the_clock_is_unobservable_and_not_named() -> None:
    wrong = WrongNumber(number="camera_clock", size=0.01)
    assert contradicted(sightings(EVEN, (wrong,), 3)) == ()


@pytest.mark.parametrize("size", [-0.45, 0.45])
def test_a_band_width_beyond_the_sizes_that_are_measured_is_named(size: float) -> None:
    seen = sightings(RAMPED, (WrongNumber(number="band_width", size=size),), 7)
    # Bands beyond 0.87 to 1.2 of the expected area are no bands.
    kept = replace(seen, area=float(np.clip(seen.area, math.log(0.87), math.log(1.2))))
    (found,) = contradicted(kept)
    assert "band_width" in found.names


@pytest.mark.parametrize("number", ["encoder_scale", "frame_times"])
@pytest.mark.parametrize("size", [-0.06, 0.08])
def test_a_scale_is_found_where_each_marker_was_seen_once(number: str, size: float) -> None:
    seen = sightings(RAMPED, (WrongNumber(number=number, size=size),), 7)
    # The last marker was wound 30 rad late: with its wound angle as it was it would be 2 rad off.
    once = replace(seen, rows=seen.rows[seen.rows[:, LAP] == 0])
    found = contradicted(once)
    assert found
    assert number in found[0].names, found[0].sentence


def test_outliers_neither_raise_nor_hide_a_contradiction() -> None:
    for size in (0.0, 0.03):
        wrong = (WrongNumber(number="cylinder_diameter", size=size),)
        seen = sightings(RAMPED, wrong, 11)
        seen.rows[::12, 4] += 0.1
        found = contradicted(seen)
        assert ["cylinder_diameter" in item.names for item in found] == [True] * bool(size)


@pytest.mark.parametrize("laps", [40, 900])
def test_the_first_and_the_newest_laps_are_explained_whatever_the_length(laps: int) -> None:
    one = sightings(RAMPED, (), 1)
    some = one.rows[one.rows[:, MARKER] == 0][:20]
    rows = np.vstack([some] * laps)
    rows[:, LAP] = np.repeat(np.arange(laps), 20)
    kept = Seen.of(**{**vars(one), "rows": rows}).rows
    assert len(kept) <= 400
    assert set(kept[:, LAP]) == {0, 1, 2, *range(laps - 3, laps)}
