"""Lens and pose of the tracker's camera, against OpenCV's and the simulated one."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from marker_tracker_node import CameraPose, PinholeCamera
from marker_tracker_node.camera.pinhole import plane_of_pixel
from winding_rig_node.camera import CameraConfig
from winding_rig_node.camera.optics import project_points

K = np.array([[1600.0, 0.0, 958.0], [0.0, 1605.0, 541.0], [0.0, 0.0, 1.0]])
STRONG = np.array([-0.35, 0.12, 1.0e-3, -8.0e-4, 0.0])


def camera(**changes):
    fields = {"width": 1920, "height": 1080, "k": K, "d": STRONG}
    return PinholeCamera.from_info(**{**fields, **changes})


def undistorted(pinhole, pixels):
    view = pinhole.view(CameraPose())
    return np.array([plane_of_pixel(view, u, v) for u, v in pixels])


def test_undistortion_inverts_the_lens_to_a_millionth_of_a_pixel():
    pixels = np.array([[5.0, 5.0], [1900.0, 1060.0], [960.0, 540.0], [100.0, 900.0]])
    plane = undistorted(camera(), pixels)
    back, _ = cv2.projectPoints(
        np.column_stack([plane, np.ones(len(plane))]), np.zeros(3), np.zeros(3), K, STRONG
    )
    np.testing.assert_allclose(back.reshape(-1, 2), pixels, atol=1e-6)


def test_five_iterations_would_not_be_enough():
    pixels = np.array([[[5.0, 5.0]]])
    habit = cv2.undistortPoints(pixels, K, STRONG).reshape(2)
    # What the default of OpenCV leaves at the corner, in pixels.
    assert np.abs(habit - undistorted(camera(), pixels[0])[0]).max() * 1600.0 > 0.1


def test_roi_and_binning_move_the_pixel_grid_as_rep_104_says():
    binned = camera(roi=(300, 393, 960, 288), binning=3)
    assert binned.shape == (96, 320)
    inner = np.array([[10.0, 20.0]])
    full = np.array([[300 + 3 * 10.5 - 0.5, 393 + 3 * 20.5 - 0.5]])
    np.testing.assert_allclose(undistorted(binned, inner), undistorted(camera(), full), atol=1e-12)


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (4e-3, -7e-3, 9e-3)])
def test_pose_means_the_same_to_tracker_and_simulated_camera(tilt):
    config = replace(CameraConfig(), tilt=tilt)
    info = config.calibration()
    pinhole = PinholeCamera.from_info(
        width=info.width, height=info.height, k=info.k, d=info.d, roi=info.roi, binning=info.binning
    )
    points = np.array([[0.017, 0.0, 0.0], [0.03, 0.004, 0.09], [0.02, -0.008, 0.05]])
    pose = CameraPose(position=config.position, tilt=tilt)
    # Two implementations of one convention.
    np.testing.assert_allclose(
        pinhole.pixels(points, pose), project_points(config, points), atol=1e-9
    )


NO_CAMERAS = [
    ({"k": np.zeros(9)}, "not calibrated"),
    ({"k": np.full(9, np.nan)}, "not calibrated"),
    ({"distortion_model": "fisheye"}, "distortion_model"),
    ({"d": [0.1, 0.2]}, "5 finite"),
    ({"roi": (1900, 0, 100, 100)}, "leaves the sensor"),
    ({"roi": (0, 0, 2, 2), "binning": 3}, "holds no pixel"),
    ({"d": [-8.0, 0.0, 0.0, 0.0, 0.0]}, "cannot be inverted"),
]


def test_a_camera_info_that_makes_no_camera_is_refused():
    for changes, reason in NO_CAMERAS:
        with pytest.raises(ValueError, match=reason):
            camera(**changes)


def test_an_empty_distortion_and_zero_roi_mean_the_plain_whole_sensor():
    plain = camera(d=[], roi=(0, 0, 0, 0), binning=0)
    assert plain.shape == (1080, 1920)
    np.testing.assert_allclose(undistorted(plain, np.array([[958.0, 541.0]])), 0.0, atol=1e-15)
