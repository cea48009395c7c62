"""Camera and encoder of a real machine: clocks that differ, pauses, rates, losses, jitter."""

import numpy as np
import pytest
from marker_film import DRIVE, UNSEEN, axes, encoder

from marker_tracker_node.tracking.checks.camera_clock import ClockSettings
from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker

pytestmark = pytest.mark.slow

EPOCH, REST, FPS, STOP = 1.8e9, 0.3, 50.0, 9.0
# Of a length, as the specification asks.
SHARE = 0.002


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
    assert raw.published
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


@pytest.mark.parametrize("offset", [0.2, 3600.0])
def test_beyond_the_limit_frames_are_refused_in_one_sentence(pictures, offset):
    cell = Cell(pictures, offset=offset, limit=0.1)
    assert "limit camera_clock_limit 100 ms: frames are refused" in cell.live.clock.refusal
    assert cell.valid == 0


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
