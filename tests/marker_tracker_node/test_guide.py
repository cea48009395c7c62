"""Guide readings with another zero, scale or sign: used where possible, said where not."""

import math

import numpy as np
import pytest

pytestmark = pytest.mark.slow


def wound(film, guide_of, fps=20.0):
    """A tracker that has followed a film until the third marker has come round once more."""
    tracker = film.tracker()
    stop = (film.theta[3] + 4.0) / 1.74 + 0.5
    for t, frame, angle, guide in film.frames(fps, stop=stop):
        tracker.track(frame, t, angle, guide_of(guide))
    return tracker


@pytest.mark.parametrize(
    ("case", "offset"), [(4, 17.0e-3), (4, -21.0e-3), (9, 15.5e-3), (9, -0.34)]
)
def test_the_zero_of_the_guide_does_not_matter(smooth_film, case, offset):
    film = smooth_film(case)
    tracker = wound(film, lambda guide: guide + offset)
    s = tracker.estimates()["s"][1:4]
    # The specification's bar.
    np.testing.assert_allclose(s, film.s[1:4], rtol=0.002)
    assert tracker.report().healthy
    assert tracker.report().guide_doubt == ""


@pytest.mark.parametrize(
    ("guide_of", "word"),
    [
        (lambda guide: 1000.0 * guide, "millimetres"),
        (lambda guide: 85.0 - 1000.0 * guide, "reversed"),
        (lambda guide: 0.02 - guide, "reversed"),
        (lambda guide: 0.031, "scale"),
    ],
    ids=["mm", "reversed mm", "reversed", "stuck"],
)
def test_a_guide_that_contradicts_the_pictures_is_said_and_not_believed(
    smooth_film, guide_of, word
):
    film = smooth_film(9)
    tracker = wound(film, guide_of)
    np.testing.assert_allclose(tracker.estimates()["s"][1:4], film.s[1:4], rtol=0.002)
    report = tracker.report()
    assert word in report.guide_doubt
    assert not report.healthy


def test_a_guide_whose_scale_is_plausible_but_wrong_is_said(smooth_film):
    film = smooth_film(9)
    tracker = wound(film, lambda guide: 1.6 * guide)
    report = tracker.report()
    assert not report.healthy
    assert report.doubts


def test_markers_that_never_come_are_said(smooth_film):
    film = smooth_film(9)
    film.theta = np.where(np.arange(film.theta.size) == 0, film.theta, math.nan)
    tracker = film.tracker()
    for t, frame, angle, guide in film.frames(8.0, stop=12.0):
        tracker.track(frame, t, angle, guide)
    report = tracker.report()
    assert report.known == 1
    assert report.missing == (1,)
    assert not report.healthy
