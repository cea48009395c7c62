"""Frames of a run: the specification's accuracy, dots and colours, and bursts of them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from marker_film import FULL_VIEW, SENSOR, UNSEEN, dark_where, rms

from winding_rig_node.camera import CameraConfig, Light, Paint, paint_of_hue

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("case", "theta_bar", "z_bar"),
    [(3, 3.0e-3, 0.12e-3), (5, 3.0e-3, 0.12e-3), (9, 1.0e-3, 0.05e-3), (12, 1.0e-3, 0.05e-3)],
)
def test_single_frames_meet_the_specified_accuracy(smooth_film, case, theta_bar, z_bar):
    film = smooth_film(case, camera=SENSOR)
    _, records, angles = film.followed(4.0)
    facing = (angles[:, None] - film.theta + math.pi) % (2.0 * math.pi) - math.pi
    use = ((records["flags"] & UNSEEN) == 0) & (np.abs(facing) <= math.radians(60.0))
    use[:, 0] = False
    assert use.sum() > 30
    assert rms((records["theta"] - film.theta)[use]) <= theta_bar
    assert rms((records["z"] - film.z)[use]) <= z_bar


@pytest.mark.parametrize("case", [9, 10])
def test_a_band_that_comes_into_the_picture_is_measured_when_it_is_whole(smooth_film, case):
    film = smooth_film(case, camera=replace(CameraConfig(), light=Light(gain=1.2, highlight=0.3)))
    tracker = film.tracker()
    for t, frame, angle, guide in film.frames(30.0, stop=9.0):
        # P0 is sought beside its place, as by one who doubts the camera's clock.
        tracker.track(frame, t, angle, guide, beside=0.4)
        off = math.remainder(float(tracker.seen[0]) - angle, 2.0 * math.pi)
        # A pixel is 7 mrad there, and the mask is biased by a tenth of one; the rest is highlight.
        assert not abs(off) > 4.0e-3
    assert np.isfinite(tracker.estimates()["theta"][:2]).all()


DOT = 3.0e-3
HUES = (0.0, 50.0, 120.0, 230.0, 300.0)


def track(film, fps, dark=None, **config):
    """Track a run; return its records, and errors of what was measured of P1 and later."""
    change = None if dark is None else dark_where(dark)
    _, records, _ = film.followed(fps, film.tracker(**config), change)
    valid = (records["flags"] & UNSEEN) == 0
    valid[:, 0] = False
    return records, (records["theta"] - film.theta)[valid], (records["z"] - film.z)[valid]


def painted(*hues):
    return {"paint": Paint(markers=tuple(paint_of_hue(hue) for hue in hues))}


@pytest.mark.parametrize(("case", "theta_bar", "z_bar"), [(3, 3.0e-3, 0.12e-3), (9, 1e-3, 0.05e-3)])
def test_dots_on_the_full_sensor_meet_the_accuracy_of_bands(smooth_film, case, theta_bar, z_bar):
    _, theta, z = track(smooth_film(case, camera=SENSOR, dot_size=DOT), 2.0)
    assert theta.size > 15
    assert rms(theta) <= theta_bar
    assert rms(z) <= z_bar


def test_dots_in_the_live_window_are_followed(smooth_film):
    # A tenth of a pixel is 0.7 mrad and 0.024 mm there.
    records, theta, z = track(smooth_film(9, dot_size=DOT), 25.0)
    assert np.isfinite(records["theta"][-1]).all()
    assert np.abs(theta).max() < 5.0e-3
    assert np.abs(z).max() < 0.15e-3


def test_a_twisted_cable_moves_dots_along_z_by_no_more_than_the_deviation(smooth_film):
    film = smooth_film(9, camera=FULL_VIEW, dot_size=DOT)
    twist, plain = 0.1, film.scene

    def twisted(angle, guide_z, **changes):
        signs = np.array([-1.0, 1.0, -1.0, 1.0, -1.0])
        return plain(angle, guide_z, torsion=twist * signs, **changes)

    film.scene = twisted
    records, _, z = track(film, 8.0, dot_torsion=twist)
    sigma = records["sigma_z"][-1, 1:]
    radius = film.case.cable_radius
    assert np.abs(z).max() > radius * twist
    assert (sigma > radius * twist).all()
    assert np.abs(z).max() < 2.0 * sigma.max()


def test_every_marker_may_have_a_colour_of_its_own(paper_film):
    film = paper_film(9, camera=FULL_VIEW, **painted(*HUES))
    records, theta, z = track(film, 8.0, marker_hue=HUES[0], marker_hues=HUES)
    assert np.isfinite(records["theta"][-1]).all()
    assert np.abs(theta).max() < 8.0e-3
    assert np.abs(z).max() < 0.15e-3


@pytest.mark.parametrize("spacing", [1.0, 0.55], ids=["spacing right", "spacing too short"])
def test_a_missed_arrival_shifts_no_number_where_colours_identify(paper_film, spacing):
    film = paper_film(9, camera=FULL_VIEW, **painted(*HUES))
    first = film.theta[1]
    records, theta, _ = track(
        film,
        12.0,
        dark=lambda angle: first - 1.5 < angle < first + 1.3,
        marker_hue=HUES[0],
        marker_hues=HUES,
        marker_spacing=spacing * film.case.marker_spacing,
    )
    assert np.isfinite(records["theta"][-1, 2:]).all()
    assert np.abs(theta).max() < 0.02


FIELDS = ("theta", "z", "s", "x", "y", "sigma_theta", "sigma_z")


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
    assert together.shape == (len(rows) - 1, 5)
    for name in FIELDS:
        # The specification's bar; x and y are single precision by the record's definition.
        np.testing.assert_allclose(together[name], apart[name][1:], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(together["flags"], apart["flags"][1:])
    np.testing.assert_array_equal(one.state.mark_rows, other.state.mark_rows)


def test_a_burst_that_does_not_fit_is_refused(paper_film):
    film = paper_film(4)
    tracker, *_ = film.followed(30.0, stop=0.1)
    recorded = list(film.frames(400.0, start=0.11, stop=0.15))
    times, frames, angles, _ = (np.array(part) for part in zip(*recorded, strict=True))
    for spoilt in (
        (frames[:, :-1], times, angles),
        (frames.astype(float), times, angles),
        (frames, times[::-1], angles),
        (frames, times, angles[:-1]),
    ):
        with pytest.raises(ValueError, match=r"frames|times"):
            tracker.process(*spoilt)
