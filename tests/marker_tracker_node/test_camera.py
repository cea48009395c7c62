"""The camera: lens and pose against OpenCV's and the simulated one, calibration, camera file."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from marker_film import pinhole

from marker_tracker_node import CameraPose, PinholeCamera
from marker_tracker_node.camera.calibration import (
    Board,
    CalibrationError,
    calibrate,
    read_camera,
    write_board,
    write_camera,
)
from marker_tracker_node.camera.pinhole import plane_of_pixel
from winding_rig_node.camera import CameraConfig
from winding_rig_node.camera.optics import project_points

K = np.array([[1600.0, 0.0, 958.0], [0.0, 1605.0, 541.0], [0.0, 0.0, 1.0]])
STRONG = np.array([-0.35, 0.12, 1.0e-3, -8.0e-4, 0.0])


def camera(**changes):
    fields = {"width": 1920, "height": 1080, "k": K, "d": STRONG}
    return PinholeCamera(**{**fields, **changes})


def undistorted(lens, pixels):
    view = lens.view(CameraPose())
    return np.array([plane_of_pixel(view, u, v) for u, v in pixels])


def test_undistortion_inverts_the_lens_to_a_millionth_of_a_pixel():
    pixels = np.array([[5.0, 5.0], [1900.0, 1060.0], [960.0, 540.0], [100.0, 900.0]])
    plane = undistorted(camera(), pixels)
    back, _ = cv2.projectPoints(
        np.column_stack([plane, np.ones(len(plane))]), np.zeros(3), np.zeros(3), K, STRONG
    )
    np.testing.assert_allclose(back.reshape(-1, 2), pixels, atol=1e-6)


def test_roi_and_binning_move_the_pixel_grid_as_in_rep_104():
    binned = camera(roi=(300, 393, 960, 288), binning=3)
    assert binned.shape == (96, 320)
    inner = np.array([[10.0, 20.0]])
    full = np.array([[300 + 3 * 10.5 - 0.5, 393 + 3 * 20.5 - 0.5]])
    np.testing.assert_allclose(undistorted(binned, inner), undistorted(camera(), full), atol=1e-12)


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (4e-3, -7e-3, 9e-3)])
def test_pose_means_the_same_to_tracker_and_simulated_camera(tilt):
    config = replace(CameraConfig(), tilt=tilt)
    points = np.array([[0.017, 0.0, 0.0], [0.03, 0.004, 0.09], [0.02, -0.008, 0.05]])
    pose = CameraPose(position=config.position, tilt=tilt)
    # Two implementations of one convention.
    seen = pinhole(config).pixels(points, pose)
    np.testing.assert_allclose(seen, project_points(config, points), atol=1e-9)


NO_CAMERAS = [
    ({"k": np.zeros(9)}, "not calibrated"),
    ({"k": np.full(9, np.nan)}, "not calibrated"),
    ({"distortion_model": "fisheye"}, "distortion_model"),
    ({"d": [0.1, 0.2]}, "5 finite"),
    ({"roi": (1900, 0, 100, 100)}, "leaves the sensor"),
    ({"roi": (0, 0, 2, 2), "binning": 3}, "holds no pixel"),
    ({"d": [-8.0, 0.0, 0.0, 0.0, 0.0]}, "folds the picture"),
    ({"d": [0.0, 0.0, 9.0, 0.0, 0.0]}, "cannot be inverted"),
]


def test_a_camera_info_that_makes_no_camera_is_refused():
    for changes, reason in NO_CAMERAS:
        with pytest.raises(ValueError, match=reason):
            camera(**changes)


def test_an_empty_distortion_and_zero_roi_mean_the_plain_whole_sensor():
    plain = camera(d=[], roi=(0, 0, 0, 0), binning=0)
    assert plain.shape == (1080, 1920)
    np.testing.assert_allclose(undistorted(plain, np.array([[958.0, 541.0]])), 0.0, atol=1e-15)


BOARD_K = np.array([[1125.0, 0.0, 487.0], [0.0, 1126.5, 266.0], [0.0, 0.0, 1.0]])
BOARD_D = np.array([-0.2, 0.08, 6e-4, -4e-4, 0.0])
SIZE = (960, 540)
CHARUCO = Board(columns=14, rows=8, square=8e-3, marker=6e-3)
# Debian's package opencv-doc; the photographs have no licence of their own, so none is kept here.
REAL = Path("/usr/share/doc/opencv-doc/examples/data")


@cache
def rays_of_every_pixel():
    """Directions with unit depth, the lens inverted by fixed point."""
    u, v = np.meshgrid(np.arange(SIZE[0], dtype=float), np.arange(SIZE[1], dtype=float))
    goal = np.stack(
        [(u - BOARD_K[0, 2]) / BOARD_K[0, 0], (v - BOARD_K[1, 2]) / BOARD_K[1, 1]], axis=-1
    ).reshape(-1, 2)
    plane = goal.copy()
    for _ in range(25):
        x, y = plane.T
        q = x * x + y * y
        radial = 1.0 + q * (BOARD_D[0] + q * BOARD_D[1])
        skew = [
            2.0 * BOARD_D[2] * x * y + BOARD_D[3] * (q + 2.0 * x * x),
            BOARD_D[2] * (q + 2.0 * y * y) + 2.0 * BOARD_D[3] * x * y,
        ]
        plane = (goal - np.stack(skew, axis=-1)) / radial[:, None]
    return np.column_stack([plane, np.ones(len(plane))])


def photograph(picture, size, rotation, shift):
    """A flat print seen through the lens: every pixel's ray meets the board's plane."""
    rays = rays_of_every_pixel()
    turn = cv2.Rodrigues(np.array(rotation))[0]
    normal = turn[:, 2]
    depth = (normal @ shift) / (rays @ normal)
    board = (rays * depth[:, None] - shift) @ turn
    scale = picture.shape[1] / size[0]
    x = (board[:, 0] * scale - 0.5).reshape(SIZE[1], SIZE[0]).astype(np.float32)
    y = (board[:, 1] * scale - 0.5).reshape(SIZE[1], SIZE[0]).astype(np.float32)
    return cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderValue=(90, 90, 90))


def views(count=14):
    print_ = CHARUCO.charuco().picture((1400, 800))
    print_ = cv2.cvtColor(print_, cv2.COLOR_GRAY2BGR)
    rng = np.random.default_rng(5)
    for _ in range(count):
        rotation = rng.uniform(-0.6, 0.6, 3)
        shift = np.array([-0.056, -0.032, 0.16]) + rng.uniform(-0.02, 0.02, 3)
        picture = photograph(print_, (14 * 8e-3, 8 * 8e-3), rotation, shift).astype(float)
        yield np.clip(picture + 2.0 * rng.standard_normal(picture.shape), 0, 255).astype(np.uint8)


@pytest.mark.slow
def test_a_charuco_board_gives_the_lens_back():
    result = calibrate(list(views()), CHARUCO)
    assert result.views == 14
    assert result.residual < 0.3
    # A shift of the picture is a turn of the camera, which the pose takes up; the rest is the
    # lens. 24 views were measured to leave 0.006 px and 6 views 0.017 px rms on larger pictures.
    grid = np.stack(np.meshgrid(np.linspace(75, 885, 6), np.linspace(45, 495, 4)), -1)
    real = PinholeCamera(width=960, height=540, k=BOARD_K, d=BOARD_D)
    views_of = (pinhole.view(CameraPose()) for pinhole in (result.camera, real))
    rays, truth = (
        np.array([plane_of_pixel(view, u, v) for u, v in grid.reshape(-1, 2)]) for view in views_of
    )
    found, true = (np.column_stack([part, np.ones(len(part))]) for part in (rays, truth))
    found, true = (part / np.linalg.norm(part, axis=1)[:, None] for part in (found, true))
    left, _, right = np.linalg.svd(true.T @ found)
    off = (found @ (left @ right).T - true) * 1125.0
    assert np.sqrt((off**2).sum(axis=1).mean()) < 0.5
    assert result.camera.k[0, 0] == pytest.approx(1125.0, rel=0.005)


def test_photographs_without_a_board_are_counted_and_too_few_refused():
    good = list(views(4))
    blank = np.full_like(good[0], 128)
    assert calibrate([*good, blank], CHARUCO).refused == 1
    with pytest.raises(CalibrationError, match="at least 4"):
        calibrate([good[0], blank, blank], CHARUCO)
    with pytest.raises(CalibrationError, match="one size"):
        calibrate([good[0], good[1][:-1]], CHARUCO)


@pytest.mark.parametrize("more", [-1, 1])
@pytest.mark.parametrize("marker", [6e-3, None])
def test_inner_corners_given_as_squares_are_named(more, marker):
    shown = replace(CHARUCO, marker=marker)
    print_ = cv2.copyMakeBorder(
        shown.picture(12_500.0), 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255
    )
    given = replace(shown, columns=14 + more, rows=8 + more)
    with pytest.raises(CalibrationError, match="14 x 8 squares, which has 13 x 7 inner corners"):
        calibrate([print_] * 4, given)


@pytest.mark.parametrize(
    ("k1", "k2", "k3", "folds"),
    [
        # A corner lies 0.497 focal lengths from the centre; the picture folds where
        # 1 + 7 k3 r^6 = 0, at 0.516 and 0.453 focal lengths.
        pytest.param(0.0, 0.0, -3.0, False, id="grows up to the corner"),
        pytest.param(0.0, 0.0, -6.6, True, id="folds before it"),
        pytest.param(0.0, 0.0, -5.0e-324, False, id="as good as straight"),
        pytest.param(-1.6, 0.0, 0.0, True, id="barrel"),
        pytest.param(0.6, 0.3, 0.2, False, id="pincushion"),
    ],
)
def test_a_lens_that_folds_its_picture_is_refused(k1, k2, k3, folds):
    given = {"width": SIZE[0], "height": SIZE[1], "k": BOARD_K, "d": [k1, k2, 0.0, 0.0, k3]}
    if not folds:
        PinholeCamera(**given)
        return
    with pytest.raises(ValueError, match="folds the picture"):
        PinholeCamera(**given)
    # In a window around the centre no ray comes near the fold.
    PinholeCamera(**given, roi=(430, 210, 100, 100))


def test_real_chessboards_of_opencv():
    files = sorted(REAL.glob("left[0-9][0-9].jpg"))
    if not files:
        pytest.skip(f"Debian's opencv-doc is not installed: no left01.jpg in {REAL}")
    pictures = [cv2.imread(str(file)) for file in files]
    result = calibrate(pictures, Board(columns=10, rows=7, square=25e-3))
    assert result.views >= 11
    # 0.183 px were measured on 13 of them.
    assert result.residual < 0.3


IMPOSSIBLE_BOARDS = [
    ({"columns": 2}, "at least 3 x 3"),
    ({"square": 0.0}, "square"),
    ({"marker": 0.01}, "smaller"),
    ({"dictionary": "DICT_0"}, "unknown"),
]


def test_an_impossible_board_is_refused():
    for fields, reason in IMPOSSIBLE_BOARDS:
        with pytest.raises(CalibrationError, match=reason):
            Board(**{"columns": 14, "rows": 8, "square": 8e-3, "marker": 6e-3, **fields})


def test_the_camera_file_comes_back_and_is_the_standard_one(tmp_path):
    camera = PinholeCamera(
        width=1920, height=1080, k=BOARD_K, d=BOARD_D, roi=(0, 393, 1920, 288), binning=3
    )
    path = tmp_path / "camera.yaml"
    write_camera(path, camera, "high_speed")
    back = read_camera(path)
    np.testing.assert_array_equal(back.k, camera.k)
    np.testing.assert_array_equal(back.d, camera.d)
    assert (back.roi, back.binning) == (camera.roi, camera.binning)
    content = yaml.safe_load(path.read_text())
    assert content["camera_name"] == "high_speed"
    assert content["camera_matrix"]["rows"] == 3
    assert len(content["projection_matrix"]["data"]) == 12


NO_CAMERA_FILES = [
    ("[1, 2", "not YAML"),
    ("image_width: 5", "missing"),
    ("just words", "missing"),
    (
        "{image_width: 640, image_height: 480, camera_matrix: {data: [0,0,0,0,0,0,0,0,0]}, "
        "distortion_coefficients: {data: [0,0,0,0,0]}}",
        "not calibrated",
    ),
]


def test_a_file_that_is_no_camera_is_refused(tmp_path):
    path = tmp_path / "camera.yaml"
    for text, reason in NO_CAMERA_FILES:
        path.write_text(text)
        with pytest.raises(CalibrationError, match=reason):
            read_camera(path)
    with pytest.raises(CalibrationError, match="cannot read"):
        read_camera(tmp_path / "nothing.yaml")


@pytest.mark.parametrize("marker", [0.006, None])
def test_the_printed_board_is_the_one_that_is_looked_for(tmp_path, marker):
    board = Board(columns=14, rows=8, square=0.008, marker=marker)
    width, height = write_board(tmp_path / "board.png", board, 600.0)
    # A dot of 1/600 inch is 0.042 mm.
    assert (width, height) == pytest.approx((0.112, 0.064), abs=14 * 0.000042)
    printed = cv2.imread(str(tmp_path / "board.png"))
    # A board is photographed with paper around it.
    photograph = cv2.copyMakeBorder(printed, 80, 80, 80, 80, cv2.BORDER_CONSTANT, value=(255,) * 3)
    points, pixels = board.corners(photograph)
    assert len(points) == 13 * 7
    side = 0.008 * 600.0 / 0.0254
    spacing = np.linalg.norm(pixels[1] - pixels[0])
    assert spacing == pytest.approx(side, abs=0.6)


def test_a_board_too_small_to_print_and_a_missing_folder_are_refused(tmp_path):
    board = Board(columns=14, rows=8, square=0.0002, marker=None)
    with pytest.raises(CalibrationError, match="8 dots or more"):
        write_board(tmp_path / "board.png", board, 600.0)
    board = Board(columns=14, rows=8, square=0.008, marker=None)
    with pytest.raises(OSError, match="folder is missing"):
        write_board(tmp_path / "nowhere" / "board.png", board, 600.0)
