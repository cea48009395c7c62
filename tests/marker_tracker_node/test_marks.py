"""Markers that are printed dots, and markers of several colours, from the picture to numbers."""

from dataclasses import replace

import numpy as np
import pytest

from winding_core.markers import MarkerFlag
from winding_rig_node.camera import CameraConfig, Paint, Window, paint_of_hue

pytestmark = pytest.mark.slow

UNSEEN = int(MarkerFlag.NOT_WOUND | MarkerFlag.PREDICTED)
FULL_VIEW = CameraConfig().full_frame(3)
# The part of the full 1920x1080 sensor, pixel by pixel, that the cable can reach.
SENSOR = replace(
    CameraConfig(), window=Window(x_offset=240, y_offset=100, width=1000, height=880, binning=1)
)
DOT = 3.0e-3
HUES = (0.0, 50.0, 120.0, 230.0, 300.0)


def track(film, fps, dark=None, **config):
    """Track a run; return its records, and errors of what was measured of P1 and later."""
    tracker, records = film.tracker(**config), []
    for t, frame, angle, guide in film.frames(fps):
        if dark is not None and dark(angle):
            frame[:] = 40
        records.append(tracker.track(frame, t, angle, guide))
    records = np.stack(records)
    valid = (records["flags"] & UNSEEN) == 0
    valid[:, 0] = False
    return records, (records["theta"] - film.theta)[valid], (records["z"] - film.z)[valid]


def rms(values):
    return np.sqrt((values**2).mean())


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


def test_a_twisted_cable_moves_dots_along_z_by_no_more_than_is_said(smooth_film):
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


def test_dots_may_have_colours(paper_film):
    film = paper_film(9, camera=FULL_VIEW, dot_size=DOT, **painted(0.0, 50.0))
    records, theta, _ = track(film, 8.0, marker_hue=0.0, marker_hues=(0.0, 50.0))
    assert np.isfinite(records["theta"][-1]).all()
    assert np.abs(theta).max() < 8.0e-3


@pytest.mark.parametrize("spacing", [1.0, 0.55], ids=["spacing told", "spacing told too short"])
def test_a_missed_arrival_shifts_no_number_where_colours_tell(paper_film, spacing):
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
