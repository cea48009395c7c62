"""Bursts of frames: the same numbers as one frame after the other, and faster than the camera."""

import copy

import numpy as np
import pytest

pytestmark = pytest.mark.slow

FIELDS = ("theta", "z", "s", "x", "y", "sigma_theta", "sigma_z")


@pytest.fixture(scope="module")
def burst(paper_film):
    """A tracker that knows every marker, and frames with all of them in sight."""
    film = paper_film(4)
    tracker = film.tracker()
    for t, frame, angle, guide in film.frames(30.0, stop=14.9):
        tracker.track(frame, t, angle, guide)
    recorded = list(film.frames(400.0, start=14.91, stop=15.21))
    times, frames, angles, guides = (np.array(part) for part in zip(*recorded, strict=True))
    return tracker, frames, times, angles, guides


def test_burst_and_single_frames_agree(burst):
    tracker, frames, times, angles, guides = burst
    one, other = copy.deepcopy(tracker), copy.deepcopy(tracker)
    together = one.process(frames, times, angles, guides)
    apart = np.stack([other.track(*row) for row in zip(frames, times, angles, guides, strict=True)])
    assert together.shape == (len(frames), 5)
    for name in FIELDS:
        # The specification's bar; x and y are single precision by the record's definition.
        np.testing.assert_allclose(together[name], apart[name], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(together["flags"], apart["flags"])
    np.testing.assert_array_equal(one.state.mark_rows, other.state.mark_rows)


def test_a_whole_run_in_bursts_is_the_run(paper_film):
    film = paper_film(9)
    one, other = film.tracker(), film.tracker()
    rows = [(frame, t, angle, guide) for t, frame, angle, guide in film.frames(20.0)]
    apart = np.stack([one.track(*row) for row in rows])
    other.track(*rows[0])
    together = []
    for first in range(1, len(rows), 64):
        part = zip(*rows[first : first + 64], strict=True)
        frames, times, angles, guides = (np.array(column) for column in part)
        together.append(other.process(frames, times, angles, guides))
    together = np.concatenate(together)
    for name in FIELDS:
        np.testing.assert_allclose(together[name], apart[name][1:], rtol=0, atol=1e-9)


def test_a_burst_that_does_not_fit_is_refused(burst):
    tracker, frames, times, angles, _ = burst
    for spoilt in (
        (frames[:, :-1], times, angles),
        (frames.astype(float), times, angles),
        (frames, times[::-1], angles),
        (frames, times, angles[:-1]),
    ):
        with pytest.raises(ValueError, match=r"frames|times"):
            copy.deepcopy(tracker).process(*spoilt)
