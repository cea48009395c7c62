"""Bad frames, bad encoders, bad clocks: refused or bridged, always reported, never garbage."""

import copy
import math

import numpy as np
import pytest
from marker_film import UNSEEN

from marker_tracker_node import FrameFault, TrackerConfig
from winding_core.markers import MARKER_DTYPE, MarkerFlag

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def running(paper_film):
    """A film and a tracker that has followed it until the third marker has landed."""
    film = paper_film(4)
    return film, film.followed(40.0, stop=12.0)[0]


@pytest.fixture
def tracker(running):
    return copy.deepcopy(running[1])


@pytest.fixture(scope="module")
def frame(running):
    film, _ = running
    return film.frame_at(20.0)


def arrays(state):
    """Every array that a tracker keeps."""
    return [state.mark_rows, state.candidate_rows, state.run_rows, state.paths]


@pytest.mark.parametrize(
    ("spoil", "t", "fault"),
    [
        (lambda f: np.empty((0, 0, 3), np.uint8), 12.1, FrameFault.EMPTY),
        (lambda f: f[:, :-1], 12.1, FrameFault.WRONG_SIZE),
        (lambda f: f[..., 0], 12.1, FrameFault.WRONG_ENCODING),
        (lambda f: f.astype(np.uint16), 12.1, FrameFault.WRONG_ENCODING),
        (lambda f: np.dstack([f, f[..., :1]]), 12.1, FrameFault.WRONG_ENCODING),
        (lambda f: f, 11.975, FrameFault.DUPLICATE),
        (lambda f: f, 3.0, FrameFault.OUT_OF_ORDER),
        (lambda f: f, math.nan, FrameFault.NOT_A_TIME),
    ],
)
def test_a_bad_frame_is_refused_counted_and_changes_nothing(tracker, frame, spoil, t, fault):
    before = copy.deepcopy(tracker.state)
    records = tracker.track(spoil(frame), t, 20.0, 0.0574)
    assert records.dtype == MARKER_DTYPE
    assert records.size == 0
    assert tracker.report().rejected[fault] == 1
    assert sum(tracker.report().rejected.values()) == 1
    for now, then in zip(arrays(tracker.state), arrays(before), strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize("level", [0, 255])
def test_a_blank_frame_yields_predictions_only(tracker, frame, level):
    records = tracker.track(np.full_like(frame, level), 12.0, 20.02, 0.0575)
    assert ((records["flags"] & UNSEEN) != 0).all()
    assert tracker.report().measured == 0


def test_noise_of_every_colour_is_never_taken_for_markers(running):
    film, _ = running
    tracker = film.tracker()
    rng = np.random.default_rng(0)
    first = film.frame_at(0.0)
    tracker.track(first, 0.0, 0.0, 0.0)
    # Of the 6 s and 1.7 turns in which P0 comes back and P1 is due.
    for k in range(1, 40):
        noise = rng.integers(0, 255, first.shape).astype(np.uint8)
        records = tracker.track(noise, k * 0.15, k * 0.261, 0.0)
        assert ((records["flags"][1:] & UNSEEN) != 0).all()


def test_a_lost_encoder_is_bridged_for_half_a_second(paper_film):
    film = paper_film(4)
    tracker = film.tracker()
    worst, lost = 0.0, 0
    for t, frame, angle, guide in film.frames(100.0, stop=9.0):
        out = 5.0 <= t < 5.5 or 7.3 <= t < 7.8
        records = tracker.track(frame, t, None if out else angle, None if out else guide)
        lost += tracker.report().encoder_lost
        valid = (records["flags"] & UNSEEN) == 0
        if valid.any():
            worst = max(worst, np.abs((records["theta"] - film.theta)[valid]).max())
    assert lost == 100
    assert tracker.report().encoder_losses == 2
    assert not tracker.report().encoder_lost
    # 0.2 % of S_1 is 12 mrad on this cylinder.
    assert worst < 12.0e-3


@pytest.mark.parametrize("period", [2.0 * math.pi, 16.0 * math.pi])
def test_an_encoder_that_wraps_is_unwrapped(paper_film, period):
    film = paper_film(4)
    tracker = film.tracker()
    for t, frame, angle, guide in film.frames(25.0):
        records = tracker.track(frame, t, math.fmod(angle, period), guide)
    assert tracker.report().encoder_wraps == round(
        (33.93 - math.fmod(33.93, period)) / (2.0 * math.pi)
    )
    np.testing.assert_allclose(tracker.estimates()["s"], film.s, rtol=0.002, atol=1e-4)
    assert records["theta"][4] == pytest.approx(film.theta[4], abs=0.02)


def test_without_any_encoder_identities_hold(paper_film):
    """Commanded speed and P0 carry the run; the start is the only instant that is known."""
    film = paper_film(4)
    tracker = film.tracker()
    for t, frame, angle, guide in film.frames(50.0):
        # The encoder works during the ramp only.
        tracker.track(frame, t, angle if t < 2.0 else None, guide if t < 2.0 else None)
    estimates = tracker.estimates()
    assert tracker.report().known == 5
    np.testing.assert_allclose(estimates["theta"], film.theta, atol=0.02)


def test_a_marker_that_cannot_be_sampled_is_reported_and_nothing_is_valid(running):
    film, _ = running
    tracker = film.tracker()
    blank = np.full((96, 640, 3), 90, np.uint8)
    records = tracker.track(blank, 0.0, 0.0, 0.0)
    assert "the picture has no colour" in tracker.report().colour_refusal
    assert not tracker.report().healthy
    assert np.isnan(records["theta"]).all()
    late = tracker.track(blank, 1.0, 3.0, 0.0)
    # The first reason stays: later ones follow from it.
    assert "the picture has no colour" in tracker.report().colour_refusal
    assert ((late["flags"] & MarkerFlag.NOT_WOUND) != 0).all()


def test_one_kind_of_report_for_a_good_run(running):
    report = running[1].report()
    assert report.healthy
    assert report.frames == 480
    assert report.known == 4
    assert report.rejected[FrameFault.DUPLICATE] == 0
    assert report.colour_separation > 0.99


def test_an_impossible_configuration_is_refused():
    fields = {"cylinder_radius": 0.015, "cable_radius": 0.002, "marker_spacing": 0.1}
    for changes in (
        {"cylinder_radius": 0.0},
        {"marker_count": 0},
        {"usable_azimuth": 2.0},
        {"slip_limit": math.nan},
        {"expected_stretch": -1.0},
    ):
        with pytest.raises(ValueError, match=f"{next(iter(changes))} must"):
            TrackerConfig(**{**fields, **changes})


def test_an_encoder_beyond_any_machine_counts_as_missing(paper_film):
    """The search goes through every lap up to the present angle, and hung."""
    film = paper_film(4)
    tracker = film.tracker()
    frame = film.frame_at(0.0)
    tracker.track(frame, 0.0, 0.0)
    for k, angle in enumerate((1e300, -1e12, 3e9), start=1):
        markers = tracker.track(frame, 0.005 * k, angle, -1e300)
        assert len(markers) == film.case.marker_count + 1
        assert tracker.report().encoder_lost
