"""Projection and band frames, against OpenCV's own camera model."""

import re

import cv2
import numpy as np
import pytest

from winding_core.machine.readings import ImageWindow
from winding_core.markers import MarkerFlag, wound_markers
from winding_dashboard.drawings.band_overlay import band_overlay, measured_count
from winding_dashboard.state.camera_view import CameraView

MATRIX = np.array([[5000.0, 0.0, 960.0], [0.0, 5000.0, 540.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.12, 0.05, 0.001, -0.0007, 0.02])
POSITION = np.array([0.4175, 0.0, 0.05])
WINDOW = ImageWindow(x_offset=0, y_offset=393, width=1920, height=288, binning=3)


def camera(tilt: tuple[float, float, float] = (0.0, 0.0, 0.0), **changes: object) -> CameraView:
    values: dict[str, object] = {
        "matrix": MATRIX, "distortion": DISTORTION, "window": WINDOW, "width": 1920,
        "height": 1080, "position": POSITION, "tilt": np.array(tilt),
    }  # fmt: skip
    return CameraView(**{**values, **changes})


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.03, -0.05, 0.02)])
def test_full_sensor_agrees_with_opencv(tilt: tuple[float, float, float]) -> None:
    view = camera(tilt, window=ImageWindow())
    points = np.random.default_rng(3).uniform([-0.02, -0.02, 0.0], [0.02, 0.02, 0.1], (50, 3))
    nominal = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    rotation = cv2.Rodrigues(np.array(tilt))[0].T @ nominal
    expected, _ = cv2.projectPoints(
        points, cv2.Rodrigues(rotation)[0], -rotation @ POSITION, MATRIX, DISTORTION
    )
    # Both are double precision; a thousandth of a pixel is far below what a screen shows.
    np.testing.assert_allclose(view.pixels(points), expected.reshape(-1, 2), atol=1e-3)


def test_window_and_binning_follow_rep_104() -> None:
    point = np.array([[0.017, 0.0, 0.05]])
    ((column, row),) = camera(window=ImageWindow()).pixels(point)
    ((u, v),) = camera().pixels(point)
    assert u == pytest.approx((column + 0.5) / 3 - 0.5)
    assert v == pytest.approx((row - 393 + 0.5) / 3 - 0.5)
    assert camera().size == (640, 96)


def overlay(angle: float, *flags: int, turned: float = 0.0) -> str:
    records = wound_markers(
        ids=np.arange(len(flags)), theta=np.zeros(len(flags)),
        z=0.02 + 0.03 * np.arange(len(flags)),
        radius=0.017, cylinder_angle=angle, flags=np.array(flags),
    )  # fmt: skip
    return band_overlay(records, camera(), cable_radius=0.002, turned=turned)


def test_every_band_that_faces_the_camera_is_framed_and_named() -> None:
    drawn = overlay(0.0, 0, 0)
    assert re.findall(r">(P\d)<", drawn) == ["P0", "P1"]
    assert drawn.count("<polygon") == 4


def test_bands_behind_the_cylinder_are_not_drawn() -> None:
    assert overlay(np.pi, 0, 0) == ""


def test_band_that_was_not_measured_is_dashed() -> None:
    assert "dasharray" not in overlay(0.0, MarkerFlag.TOUCHING)
    assert "dasharray" in overlay(0.0, MarkerFlag.PREDICTED)


def test_marker_that_is_not_wound_is_not_drawn() -> None:
    assert overlay(0.0, MarkerFlag.NOT_WOUND) == ""


def test_frame_moves_with_the_cylinder() -> None:
    assert overlay(0.1, 0) == overlay(0.0, 0, turned=0.1)


def test_only_what_this_frame_shows_counts_as_measured() -> None:
    flags = [
        0,
        MarkerFlag.TOUCHING,
        MarkerFlag.PREDICTED,
        MarkerFlag.OCCLUDED,
        MarkerFlag.NOT_WOUND,
    ]
    records = wound_markers(
        ids=np.arange(5),
        theta=np.zeros(len(flags)),
        z=0.0,
        radius=0.017,
        cylinder_angle=0.0,
        flags=np.array(flags),
    )
    assert measured_count(records) == 2
