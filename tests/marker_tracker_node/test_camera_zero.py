"""The camera's turn: from many frames at rest, never from one that is covered, or from a pass."""

import cv2
import numpy as np
import pytest

from winding_core.units import MILLIRADIAN
from winding_rig_node.camera import CameraConfig

RATE = 50.0
TILT = (4.0e-3, -3.0e-3, 0.0)
# Single frames of case 4 scatter by 0.1 px, 0.1 mrad of the camera; the band's model errs by
# 2 mrad of azimuth, which is 0.09 mrad of it.
REST_ERROR = 0.3e-3
# Over a pass both are fitted together with the encoder's zero.
PASS_ERROR = 1.0e-3


def covered(frame, share):
    """Return a frame in which the upper part of the band of P0 is hidden."""
    hsv = cv2.cvtColor(frame, cv2.COLOR_BGR2HSV)
    yellow = (hsv[..., 0] > 15) & (hsv[..., 0] < 35) & (hsv[..., 1] > 120)
    rows = np.flatnonzero(yellow[:, 80:140].any(axis=1))
    hidden = frame.copy()
    hidden[rows[0] : rows[0] + round(share * rows.size), 80:140] = 40
    return hidden


def at_rest(film, frames, hide, reading=0.0):
    tracker = film.tracker()
    for k in range(frames):
        frame = film.frame_at(0.0)
        tracker.track(covered(frame, hide[k]) if k in hide else frame, k / RATE, reading, 0.0)
    return tracker


def off(tracker, film):
    return np.abs(np.subtract(tracker.pose.tilt, film.camera.tilt))[:2].max()


@pytest.mark.parametrize(
    "hide",
    [{0: 0.25}, {0: 0.4, 1: 0.3}, dict.fromkeys(range(3), 0.1)],
    ids=["first", "two", "little, in three"],
)
@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), TILT], ids=["straight", "tilted"])
def test_covered_frames_do_not_turn_the_camera(paper_film, tilt, hide):
    film = paper_film(4, camera=CameraConfig(tilt=tilt))
    assert off(at_rest(film, 12, hide), film) < REST_ERROR


@pytest.mark.slow
@pytest.mark.parametrize(("number", "reading"), [(9, 0.1), (4, -0.07)])
def test_a_wrong_zero_of_the_encoder_is_no_tilt_once_p0_has_passed(paper_film, number, reading):
    film = paper_film(number, camera=CameraConfig(tilt=TILT).full_frame(3))
    tracker = film.tracker()
    for k in range(10):
        tracker.track(film.frame_at(0.0), k / RATE, reading, 0.0)
    for t, frame, angle, guide in film.frames(RATE, stop=5.6):
        tracker.track(frame, t + 10 / RATE, angle + reading, guide)
    assert off(tracker, film) < PASS_ERROR


@pytest.mark.slow
@pytest.mark.parametrize("number", [4, 9])
def test_a_recording_without_rest_takes_the_turn_from_a_pass(paper_film, number):
    film = paper_film(number, camera=CameraConfig(tilt=TILT).full_frame(3))
    tracker, *_ = film.followed(RATE, start=2.2, stop=5.6)
    assert off(tracker, film) < PASS_ERROR


def test_a_turn_beyond_any_calibration_is_reported_and_not_applied(paper_film):
    film = paper_film(4, camera=CameraConfig(tilt=(13.5e-3, 0.0, 0.0)))
    tracker = at_rest(film, 6, {})
    assert tracker.pose == tracker.config.pose
    (remark,) = tracker.report().remarks
    assert "limit 12.5 mrad, which is not applied" in remark
    size = float(remark.split("turned by ")[1].split()[0]) * MILLIRADIAN
    assert size == pytest.approx(13.5e-3, abs=1.0e-3)
