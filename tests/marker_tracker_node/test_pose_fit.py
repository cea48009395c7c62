"""Joint refinement: gated sightings, and runs filmed with a camera other than believed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from marker_film import SENSOR

from marker_tracker_node import CameraPose, PinholeCamera, Sightings, refine
from marker_tracker_node.detection.band import Band
from marker_tracker_node.detection.gate import empty_gates, gate_sides
from marker_tracker_node.tracking.frame.gate_prediction import predict_gate
from marker_tracker_node.tracking.sightings import GatedBands
from winding_rig_node.camera import CameraConfig

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("case", "tilt", "theta_bar", "z_bar"),
    [
        (9, (-9e-3, 4e-3, 6e-3), 0.5e-3, 0.02e-3),
        # Cable of 4 mm on 30 mm: the first two turns touch.
        (4, (6e-3, -9e-3, 5e-3), 2.0e-3, 0.05e-3),
    ],
)
def test_a_wrong_pose_is_found_and_its_error_leaves_the_markers(
    smooth_film, case, tilt, theta_bar, z_bar
):
    film = smooth_film(case, camera=replace(SENSOR, tilt=tilt))
    tracker, *_ = film.followed(7.0, film.tracker(pose=CameraPose(), remember=True))
    assert tracker.report().known == 5
    fit = refine(tracker.config, tracker.camera, tracker.sightings())
    # The specification's bars.
    assert np.abs(fit.theta - film.theta).max() <= theta_bar
    assert np.abs(fit.z - film.z).max() <= z_bar
    np.testing.assert_allclose(fit.pose.tilt, tilt, atol=1.5e-3)
    assert fit.residual < 0.5


def test_refining_needs_sightings_that_were_remembered(paper_film):
    film = paper_film(4)
    with pytest.raises(ValueError, match="remember"):
        film.tracker().sightings()
    tracker = film.tracker(remember=True)
    with pytest.raises(ValueError, match="at least 20"):
        refine(tracker.config, tracker.camera, tracker.sightings())


def test_p0_zeroes_the_pose_in_the_first_frame(paper_film):
    film = paper_film(4, camera=replace(CameraConfig(), tilt=(8e-3, -6e-3, 0.0)))
    tracker = film.tracker(pose=CameraPose())
    tracker.track(film.frame_at(0.0), 0.0, 0.0, 0.0)
    # 0.4 px of the binned window are 0.24 mrad: one frame, and P0 sits where the bend begins.
    np.testing.assert_allclose(tracker.pose.tilt, (8e-3, -6e-3, 0.0), atol=0.25e-3)
    assert isinstance(tracker.camera, PinholeCamera)


AZIMUTHS = np.array([-0.9, -0.3, 0.0, 0.5, 0.9]) + 4.0 * math.pi
HEIGHT = 4.0e-3
CUT = 1.15


def seen_through_gates(film, high):
    """Bands of one marker that are cut off at an angle around the section, gates beside them."""
    config = film.tracker().config
    body, camera, pose = config.body, film.pinhole(), config.pose
    view = camera.view(pose)
    count = AZIMUTHS.size
    right = np.full(count, math.nan)
    if high < math.pi:
        setup, gates = config.setup(view), empty_gates(1)
        for k, azimuth in enumerate(AZIMUTHS):
            predict_gate(setup, Band(azimuth, HEIGHT, 0.0, -math.pi, high), gates, 0)
            right[k] = gate_sides(gates, 0)[1]
    sightings = Sightings(
        marker=np.ones(count, int),
        angle=AZIMUTHS,
        azimuth=AZIMUTHS,
        z=np.full(count, HEIGHT),
        slope=np.zeros(count),
        low=np.full(count, -math.pi),
        high=np.full(count, high),
        below=np.full(count, math.inf),
        above=np.full(count, math.inf),
        left=np.full(count, math.nan),
        right=right,
        pose=pose,
        mean_theta=np.zeros(2),
        mean_z=np.array([0.0, HEIGHT]),
    )
    return GatedBands(camera, body, sightings), sightings, pose


@pytest.mark.parametrize("high", [CUT, math.pi])
def test_what_was_measured_comes_back(smooth_film, high):
    bands, sightings, pose = seen_through_gates(smooth_film(4), high)
    again = bands.pictures(pose, sightings.azimuth, sightings.z)
    # A gate is straight where the cable beside it bends over a band: half of 0.05 mm at 0.4 m.
    np.testing.assert_allclose(again, bands.measured, atol=7.0e-5 if high < math.pi else 1.0e-12)


def test_a_gate_that_cuts_a_band_lets_it_move_by_half(smooth_film):
    moves = []
    for high in (CUT, math.pi):
        bands, sightings, pose = seen_through_gates(smooth_film(4), high)
        before = bands.pictures(pose, sightings.azimuth, sightings.z)
        after = bands.pictures(pose, sightings.azimuth, sightings.z + 0.05e-3)
        moves.append((after - before)[:, 0])
    # The middle of a width of which one end stands; a section is an ellipse seen from the side.
    np.testing.assert_allclose(moves[0] / moves[1], 0.5, atol=0.1)
