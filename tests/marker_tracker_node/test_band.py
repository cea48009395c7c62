"""The band model: where the visible half of a ring band appears."""

import math
from dataclasses import replace

import numpy as np
import pytest

from marker_tracker_node import CameraPose
from marker_tracker_node.camera.pinhole import pixel_of_plane, plane_of_point
from marker_tracker_node.detection.band import Band, band_centroid, centre_point, solve_band
from winding_rig_node.camera import CablePath, CameraConfig, Window

pytestmark = pytest.mark.slow

# Every sensor pixel around the middle of the cylinder's first turn.
CLOSE = Window(x_offset=200, y_offset=300, width=400, height=700, binning=1)
SHARP = replace(CameraConfig(), window=CLOSE, supersampling=6)


def view_and_body(film):
    config = film.tracker().config
    return film.pinhole().view(CameraPose(position=film.camera.position)), config.body


@pytest.mark.parametrize("case", [1, 3, 5, 9])
def test_centroid_and_area_agree_with_the_renderers_ground_truth(smooth_film, case):
    film = smooth_film(case, camera=SHARP)
    view, body = view_and_body(film)
    for azimuth in (0.0, 0.35, 1.0):
        level = CablePath(theta=film.path.theta, z=np.zeros_like(film.path.z))
        made = film.scene(azimuth, 0.0, path=level)
        truth = film.renderer.visible_bands(made)[0]
        a, b, area = band_centroid(view, body, Band(azimuth, 0.0, 0.0))
        # 0.05 px is 4 um; the sections of the renderer are chords of 3 px.
        np.testing.assert_allclose(pixel_of_plane(view, a, b), truth["centroid"], atol=0.05)
        assert area * view.fx * view.fy == pytest.approx(truth["area"], rel=0.01)


def test_solving_inverts_the_model(smooth_film):
    view, body = view_and_body(smooth_film(3))
    for azimuth in (-0.3, -0.05, 0.0, 0.2, 0.6, 1.05):
        a, b, _ = band_centroid(view, body, Band(azimuth, 0.031, 1.5e-3))
        found, z = solve_band(view, body, a, b, Band(azimuth + 0.05, 0.032, 1.5e-3))
        # The fixed point stops at changes of 2e-6 rad and contracts by at least two.
        assert found == pytest.approx(azimuth, abs=4e-6)
        assert z == pytest.approx(0.031, abs=1e-7)


@pytest.mark.parametrize(("case", "least"), [(1, 30e-3), (3, 70e-3), (5, 130e-3)])
def test_without_the_model_a_band_would_be_misplaced(smooth_film, case, least):
    """The paper's radius R + r puts the visible centroid 76 to 422 mrad off at 60 degrees."""
    film = smooth_film(case)
    view, body = view_and_body(film)
    _, b, _ = band_centroid(view, body, Band(1.0, 0.0, 0.0))
    x, y, z = centre_point(body.rho, 1.0 + least, 0.0)
    _, beyond, _ = plane_of_point(view, x, y, z)
    assert b > beyond


def test_a_touching_turn_hides_what_the_renderer_hides(smooth_film):
    film = smooth_film(4, camera=SHARP)
    view, body = view_and_body(film)
    pitch = 2.0 * body.cable_radius
    slope = pitch / (2.0 * math.pi)
    touching = CablePath(theta=film.path.theta, z=slope * film.path.theta)
    theta = film.theta[1]
    # A turn after it has landed, a third of a right angle and more to the side.
    azimuth = 2.0 * math.pi + 1.0
    truth = film.renderer.visible_bands(film.scene(theta + azimuth, 0.1, path=touching))[1]
    away = pitch * body.rho / math.hypot(body.rho, slope)
    alone = Band(azimuth, slope * theta, slope)
    off, more = [], []
    for band in (alone, alone._replace(below=away, above=away)):
        a, b, area = band_centroid(view, body, band)
        off.append(abs(pixel_of_plane(view, a, b)[1] - truth["centroid"][1]))
        more.append(area * view.fx * view.fy / truth["area"] - 1.0)
    # Rays are taken for parallel over two turns, and the renderer's sections are chords of 3 px.
    assert off[1] < min(0.12, 0.5 * off[0])
    assert 0.0 < more[1] < 0.7 * more[0]
