"""Single frames of the full sensor with known pose: the specification's accuracy."""

import math
from dataclasses import replace

import numpy as np
import pytest

from winding_core.markers import MarkerFlag
from winding_rig_node.camera import CameraConfig, Window

pytestmark = pytest.mark.slow

# The part of the full 1920x1080 sensor, pixel by pixel, that the cable can reach.
SENSOR = replace(
    CameraConfig(), window=Window(x_offset=240, y_offset=100, width=1000, height=880, binning=1)
)
UNSEEN = int(MarkerFlag.NOT_WOUND | MarkerFlag.PREDICTED)


@pytest.mark.parametrize(
    ("case", "theta_bar", "z_bar"),
    [
        (3, 3.0e-3, 0.12e-3),
        (5, 3.0e-3, 0.12e-3),
        (9, 1.0e-3, 0.05e-3),
        (12, 1.0e-3, 0.05e-3),
    ],
)
def test_single_frames_meet_the_specified_accuracy(smooth_film, case, theta_bar, z_bar):
    film = smooth_film(case, camera=SENSOR)
    tracker = film.tracker()
    theta, z = [], []
    for t, frame, angle, guide in film.frames(4.0):
        records = tracker.track(frame, t, angle, guide)
        facing = (angle - film.theta + math.pi) % (2.0 * math.pi) - math.pi
        use = ((records["flags"] & UNSEEN) == 0) & (np.abs(facing) <= math.radians(60.0))
        use[0] = False
        theta.append((records["theta"] - film.theta)[use])
        z.append((records["z"] - film.z)[use])
    theta, z = np.concatenate(theta), np.concatenate(z)
    assert theta.size > 30
    assert np.sqrt((theta**2).mean()) <= theta_bar
    assert np.sqrt((z**2).mean()) <= z_bar
