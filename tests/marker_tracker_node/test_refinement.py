"""Joint refinement over a run that was filmed with a camera other than believed."""

from dataclasses import replace

import numpy as np
import pytest

from marker_tracker_node import CameraPose, PinholeCamera, Tracker, refine
from winding_rig_node.camera import CameraConfig, Window

pytestmark = pytest.mark.slow

# The part of the full sensor, pixel by pixel, that the cable can reach.
SENSOR = Window(x_offset=240, y_offset=100, width=1000, height=880, binning=1)


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
    film = smooth_film(case, camera=replace(CameraConfig(), window=SENSOR, tilt=tilt))
    tracker = Tracker(film.tracker(pose=CameraPose()).config, film.pinhole(), remember=True)
    for t, frame, angle, guide in film.frames(7.0):
        tracker.track(frame, t, angle, guide)
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
    tracker = Tracker(film.tracker().config, film.pinhole(), remember=True)
    with pytest.raises(ValueError, match="at least 20"):
        refine(tracker.config, tracker.camera, tracker.sightings())


def test_p0_zeroes_the_pose_in_the_first_frame(paper_film):
    film = paper_film(4, camera=replace(CameraConfig(), tilt=(8e-3, -6e-3, 0.0)))
    tracker = Tracker(film.tracker(pose=CameraPose()).config, film.pinhole())
    tracker.track(film.frame_at(0.0), 0.0, 0.0, 0.0)
    # 0.4 px of the binned window are 0.24 mrad: one frame, and P0 sits where the bend begins.
    np.testing.assert_allclose(tracker.pose.tilt, (8e-3, -6e-3, 0.0), atol=0.25e-3)
    assert isinstance(tracker.camera, PinholeCamera)
