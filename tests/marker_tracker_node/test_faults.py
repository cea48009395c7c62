"""Bad frames, encoders, clocks: refused, bridged or corrected, always reported, never garbage."""

import copy
import math

import numpy as np
import pytest
from marker_film import DRIVE, UNSEEN, axes, encoder

from marker_tracker_node import FrameFault, TrackerConfig
from marker_tracker_node.tracking.camera_clock import ClockSettings
from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker
from winding_core.markers import MARKER_DTYPE, MarkerFlag

pytestmark = pytest.mark.slow
EPOCH = 1.8e9
REST = 0.3
FPS = 50.0
STOP = 9.0
# Of a length, as the specification asks.
SHARE = 0.002


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
    tracker, records, _ = film.followed(25.0, read=lambda t, angle: math.fmod(angle, period))
    assert tracker.report().encoder_wraps == round(
        (33.93 - math.fmod(33.93, period)) / (2.0 * math.pi)
    )
    np.testing.assert_allclose(tracker.estimates()["s"], film.s, rtol=0.002, atol=1e-4)
    assert records["theta"][-1, 4] == pytest.approx(film.theta[4], abs=0.02)


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
        assert len(tracker.track(frame, 0.005 * k, angle, -1e300)) == film.case.marker_count + 1
        assert tracker.report().encoder_lost


def motion(t):
    return DRIVE.positions(t - REST)


@pytest.fixture(scope="module")
def pictures(paper_film):
    """A film of P0 to P4 of case 9, from standing, as (film, frames)."""
    film = paper_film(9)
    return film, [film.frame_at(*motion(k / FPS)) for k in range(int(STOP * FPS))]


class Cell:
    """A run: what the machine sends, in the order in which it comes."""

    def __init__(self, pictures, *, offset=0.0, correct=False, limit=0.25, rate=1000.0, **faults):
        film, frames = pictures
        pause, filmed = faults.get("pause", 0.0), faults.get("filmed", False)
        dice = np.random.default_rng(2)
        self.film = film
        self.live = SynchronisedTracker(ClockSettings(correct=correct, limit=limit))
        self.live.start(film.tracker())
        self.ramp_end = None
        # Published lengths as (share by which they are wrong, whether a warning stood).
        self.published = []
        self.deviations = []
        self.valid = 0

        def at(t):
            return t if t < 5.0 else max(5.0, t - pause)

        events = []
        for k in range(int((STOP + pause) * rate) + 1):
            if dice.random() >= faults.get("loss", 0.0):
                events.append((k / rate, k / rate, None))
        for k in range(int((STOP + pause) * FPS)):
            t = k / FPS
            if filmed or not 5.0 <= t < 5.0 + pause:
                events.append((t, t, frames[round(at(t) * FPS)]))
        delays = dice.uniform(0.0, faults.get("jitter", 0.0), len(events))
        latest = {True: 0.0, False: 0.0}
        arriving = []
        for (t, _, frame), delay in zip(events, delays, strict=True):
            # One topic keeps its order whatever its delays.
            kind = frame is None
            latest[kind] = max(latest[kind], t + delay)
            arriving.append((latest[kind], not kind, t, frame))
        for arrival, _, t, frame in sorted(arriving, key=lambda event: event[:3]):
            if frame is None:
                angle, guide = motion(at(t))
                self.live.add_reading(EPOCH + t, axes(encoder(angle), guide))
            else:
                self.live.add_frame(EPOCH + t + offset, frame)
            self.look()
            if self.ramp_end is None and arrival > REST + DRIVE.ramp_time:
                self.ramp_end = self.live.clock.estimate
        self.look(final=True)

    def look(self, *, final=False):
        for _, markers in self.live.measured(final=final):
            if len(markers):
                seen = (markers["flags"] & UNSEEN) == 0
                seen[0] = False
                self.valid += int(seen.sum())
                wrong = np.abs(markers["s"][seen] / self.film.s[seen] - 1.0)
                off = (markers["theta"] - self.film.theta)[seen] / markers["sigma_theta"][seen]
                self.deviations += np.abs(off).tolist()
                self.published += [(share, self.live.clock.warning) for share in wrong]

    @property
    def lengths(self):
        return self.live.tracker.estimates()["s"][1:3]


@pytest.fixture(scope="module")
def plain(pictures):
    return Cell(pictures)


@pytest.mark.parametrize("offset", [-0.2, -0.05, -0.005, 0.005, 0.05, 0.2])
def test_offset_is_found_reported_and_corrected(pictures, plain, offset):
    raw = Cell(pictures, offset=offset)
    assert raw.ramp_end.offset == pytest.approx(offset, abs=2.0e-3)  # required
    assert max(raw.deviations) < 5.0  # required
    assert all(warning for share, warning in raw.published if share > SHARE)
    corrected = Cell(pictures, offset=offset, correct=True)
    assert corrected.valid > 0.95 * plain.valid
    assert max(share for share, _ in corrected.published) < SHARE
    np.testing.assert_allclose(corrected.lengths, plain.lengths, rtol=SHARE)
    assert corrected.live.clock.warning == ""


def test_no_offset_no_warning(plain):
    assert plain.ramp_end.offset == pytest.approx(0.0, abs=2.0e-3)
    assert not any(warning for _, warning in plain.published)
    assert max(share for share, _ in plain.published) < SHARE


def test_stamps_far_from_all_readings_are_refused_in_one_sentence(pictures):
    cell = Cell(pictures, offset=3600.0, limit=0.1)
    assert "limit camera_clock_limit 100 ms: frames are refused" in cell.live.clock.refusal
    assert cell.valid == 0
    report = cell.live.report()
    assert not report.healthy
    assert any("frames were refused" in doubt for doubt in report.doubts)


def test_no_frame_is_refused_on_an_estimate(pictures):
    cell = Cell(pictures, offset=0.2, limit=0.1)
    assert sum(cell.live.tracker.report().rejected.values()) == 0
    assert "200" in cell.live.clock.warning
    assert not cell.live.report().healthy


@pytest.mark.parametrize("filmed", [True, False])
@pytest.mark.parametrize("pause", [0.5, 3.0, 30.0])
def test_a_pause_loses_no_marker_and_turns_none_over(pictures, plain, pause, filmed):
    cell = Cell(pictures, pause=pause, filmed=filmed, rate=100.0)
    np.testing.assert_allclose(cell.lengths, plain.lengths, rtol=SHARE)
    assert cell.live.tracker.report().known == plain.live.tracker.report().known
    assert max(share for share, _ in cell.published) < SHARE


@pytest.mark.parametrize("rate", [40.0, 100.0, 2000.0])
def test_rates_losses_and_jitter_change_no_length(pictures, plain, rate):
    cell = Cell(pictures, rate=rate, loss=0.05, jitter=0.02)
    np.testing.assert_allclose(cell.lengths, plain.lengths, rtol=SHARE)
    assert max(share for share, _ in cell.published) < SHARE
    assert cell.valid > 0.95 * plain.valid
