"""Intrinsic calibration from photographs of a board, and the standard camera file."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from marker_tracker_node.arrays import ByteArray, FloatArray
from marker_tracker_node.camera.pinhole import PLUMB_BOB, PinholeCamera
from winding_core.yaml_text import YamlTextError, load_yaml

_NEW = hasattr(cv2.aruco, "CharucoDetector")
# A lens bends the board by less than so many sides of a marker; of another board most lie farther.
_OFF, _MOST = 0.5, 0.5


class CharucoBoard:
    """A board of squares and markers.

    Boards with an even number of rows begin with the other colour before OpenCV 4.7: print and read
    them with the same one.

    Args:
        columns: Squares across.
        rows: Squares down.
        square: Side of a square [m].
        marker: Side of a marker [m].
        dictionary: Name of the markers' dictionary in cv2.aruco.
    """

    def __init__(
        self, columns: int, rows: int, square: float, marker: float, dictionary: str
    ) -> None:
        self._markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
        sides = (square, marker, self._markers)
        aruco: Any = cv2.aruco
        if _NEW:
            self._board = aruco.CharucoBoard((columns, rows), *sides)
        else:
            self._board = aruco.CharucoBoard_create(columns, rows, *sides)

    def picture(self, size: tuple[int, int]) -> ByteArray:
        """Return the board, black on white, for a size (width, height) [px]."""
        drawn = self._board.generateImage(size) if _NEW else self._board.draw(size)
        return np.asarray(drawn, dtype=np.uint8)

    def corners(self, grey: ByteArray) -> tuple[FloatArray, FloatArray]:
        """Return the corners that a picture shows: on the board [m], (k, 3), and in it, (k, 2)."""
        found: Any
        if _NEW:
            found, ids, _, _ = cv2.aruco.CharucoDetector(self._board).detectBoard(grey)
            all_of_them = self._board.getChessboardCorners()
        else:
            found, ids = self._interpolated(grey)
            all_of_them = self._board.chessboardCorners
        if ids is None:
            return np.zeros((0, 3)), np.zeros((0, 2))
        points = np.asarray(all_of_them, dtype=float)[np.ravel(ids)]
        return points, np.asarray(found, dtype=float).reshape(-1, 2)

    def _interpolated(self, grey: ByteArray) -> tuple[Any, Any]:
        aruco: Any = cv2.aruco
        seen, numbers, _ = aruco.detectMarkers(grey, self._markers)
        if numbers is None or not self._fits(np.concatenate(seen), np.ravel(numbers)):
            return None, None
        _, found, ids = aruco.interpolateCornersCharuco(seen, numbers, grey, self._board)
        return found, ids

    def _fits(self, seen: FloatArray, numbers: NDArray[np.intp]) -> bool:
        """Return whether markers, (k, 4, 2) [px], lie as on this board, lens aside."""
        places = np.array(self._board.objPoints)
        if numbers.max() >= len(places):
            return False
        side = float(np.median(np.linalg.norm(seen[:, 1] - seen[:, 0], axis=1)))
        known, pixels = places[numbers, :, :2].reshape(-1, 2), seen.reshape(-1, 2)
        _, near = cv2.findHomography(known, pixels, cv2.RANSAC, _OFF * side)
        return near is not None and bool(np.mean(near) >= _MOST)


LEAST_VIEWS = 4
LEAST_CORNERS = 6
_ROI = ("x_offset", "y_offset", "width", "height")


class CalibrationError(ValueError):
    """The photographs or the file do not make a camera."""


@dataclass(frozen=True, kw_only=True)
class Board:
    """A calibration board."""

    columns: int  # Squares across
    rows: int  # Squares down
    square: float  # Side of a square [m]
    marker: float | None = None  # Side of a ChArUco marker [m]; None for a plain chessboard
    dictionary: str = "DICT_4X4_250"  # Name of the ChArUco markers' dictionary in cv2.aruco

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3:
            raise CalibrationError(
                f"a board needs at least 3 x 3 squares, got {self.columns} x {self.rows}"
            )
        if not (math.isfinite(self.square) and self.square > 0.0):
            raise CalibrationError(f"square must be positive, got {self.square} m")
        if self.marker is not None and not 0.0 < self.marker < self.square:
            raise CalibrationError(
                f"marker must be smaller than the square of {self.square} m, got {self.marker}"
            )
        if not hasattr(cv2.aruco, self.dictionary):
            raise CalibrationError(f"dictionary {self.dictionary!r} is unknown to cv2.aruco")

    def charuco(self) -> CharucoBoard:
        """Return the board with its markers."""
        marker = self.marker or 0.0
        return CharucoBoard(self.columns, self.rows, self.square, marker, self.dictionary)

    def picture(self, dots_per_metre: float) -> ByteArray:
        """Return the board as it is printed, black on white, shape (height, width).

        Raises:
            CalibrationError: A square would have fewer than eight dots.
        """
        side = round(self.square * dots_per_metre)
        if side < 8:
            raise CalibrationError(
                f"a square needs 8 dots or more, {self.square} m has {side} at {dots_per_metre:g}/m"
            )
        if self.marker is not None:
            return self.charuco().picture((self.columns * side, self.rows * side))
        dark = np.add.outer(np.arange(self.rows), np.arange(self.columns)) % 2 == 0
        return np.kron(np.where(dark, 0, 255), np.ones((side, side))).astype(np.uint8)

    def corners(self, picture: ByteArray) -> tuple[FloatArray, FloatArray] | None:
        """Return board points (k, 3) [m] and their pixels (k, 2), or None without a board."""
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
        if self.marker is None:
            return self._chessboard_corners(grey)
        points, pixels = self.charuco().corners(grey)
        return (points, pixels) if len(points) >= LEAST_CORNERS else None

    def _chessboard_corners(self, grey: ByteArray) -> tuple[FloatArray, FloatArray] | None:
        size = (self.columns - 1, self.rows - 1)
        found, corners = cv2.findChessboardCorners(grey, size)
        if not found:
            return None
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1.0e-4)
        corners = cv2.cornerSubPix(grey, corners, (5, 5), (-1, -1), stop)
        points = np.zeros((size[0] * size[1], 3))
        points[:, :2] = np.mgrid[: size[0], : size[1]].T.reshape(-1, 2) * self.square
        return points, np.asarray(corners, dtype=float).reshape(-1, 2)


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What the photographs say."""

    camera: PinholeCamera  # The whole sensor
    residual: float  # Root mean square distance between corners and model [px]
    views: int  # Photographs with a board
    refused: int  # Photographs without one


def write_board(path: Path, board: Board, dots_per_inch: float) -> tuple[float, float]:
    """Write the board as a picture to print; return its printed width and height [m].

    Raises:
        CalibrationError: The squares are too small to print.
        OSError: The picture cannot be written.
    """
    dots_per_metre = dots_per_inch / 0.0254
    picture = board.picture(dots_per_metre)
    try:
        written = cv2.imwrite(str(path), picture)
    except cv2.error as error:
        raise OSError(0, f"no picture format for {path.name}") from error
    if not written:
        raise OSError(0, "the folder is missing or not writable")
    return picture.shape[1] / dots_per_metre, picture.shape[0] / dots_per_metre


def calibrate(pictures: Sequence[ByteArray], board: Board) -> Calibration:
    """Fit camera matrix and plumb_bob distortion to photographs of a board.

    Args:
        pictures: Grey or blue-green-red, all of one size.
        board: What they show.

    Raises:
        CalibrationError: Sizes differ, or fewer than four photographs show the board.
    """
    sizes = {picture.shape[:2] for picture in pictures}
    if len(sizes) != 1:
        raise CalibrationError(f"photographs must have one size, got {sorted(sizes)}")
    seen = _views(pictures, board)
    if len(seen) < LEAST_VIEWS:
        raise CalibrationError(
            f"at least {LEAST_VIEWS} photographs must show the board of {board.columns} x "
            f"{board.rows} squares, {len(seen)} of {len(pictures)} do{_shown(pictures, board)}"
        )
    height, width = sizes.pop()
    residual, matrix, distortion, _, _ = cv2.calibrateCamera(
        [points.astype(np.float32) for points, _ in seen],
        [pixels.astype(np.float32) for _, pixels in seen],
        (width, height),
        None,
        None,
    )
    try:
        camera = PinholeCamera(width=width, height=height, k=matrix, d=np.ravel(distortion)[:5])
    except ValueError as error:
        raise CalibrationError(
            f"the photographs do not determine the lens: {error}; show the board near the edges "
            "and in the corners as well, and tilted"
        ) from error
    return Calibration(
        camera=camera, residual=float(residual), views=len(seen), refused=len(pictures) - len(seen)
    )


def _views(pictures: Sequence[ByteArray], board: Board) -> list[tuple[FloatArray, FloatArray]]:
    """Return the corners of every photograph that shows the board, see `Board.corners`."""
    return [found for picture in pictures if (found := board.corners(picture)) is not None]


def _shown(pictures: Sequence[ByteArray], board: Board) -> str:
    """Return what a refusal adds when a board with one square more or less each way is there.

    Inner corners are counted as often as squares.
    """
    for more in (1, -1):
        if min(board.columns, board.rows) + more < 3:
            continue
        other = replace(board, columns=board.columns + more, rows=board.rows + more)
        found = len(_views(pictures, other))
        if found >= LEAST_VIEWS:
            return (
                f"; {found} show one of {other.columns} x {other.rows} squares, which has "
                f"{other.columns - 1} x {other.rows - 1} inner corners: count squares"
            )
    return ""


def write_camera(path: Path, camera: PinholeCamera, name: str = "camera") -> None:
    """Write the YAML that camera_info_manager and camera_calibration read and write.

    A window is kept in two more entries that those tools ignore: roi and binning.
    """
    projection = np.column_stack([camera.k, np.zeros(3)])
    content = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": _matrix(camera.k),
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": _matrix(camera.d[None]),
        "rectification_matrix": _matrix(np.eye(3)),
        "projection_matrix": _matrix(projection),
        "roi": dict(zip(_ROI, camera.roi, strict=True)),
        "binning": camera.binning,
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def read_camera(path: Path) -> PinholeCamera:
    """Read a camera file.

    Raises:
        CalibrationError: The file cannot be read or does not describe a calibrated camera.
    """
    try:
        content = load_yaml(path.read_text(encoding="utf-8"))
        roi = content.get("roi", {})
        x, y, width, height = (int(roi.get(name, 0)) for name in _ROI)
        return PinholeCamera(
            width=int(content["image_width"]),
            height=int(content["image_height"]),
            k=content["camera_matrix"]["data"],
            d=content["distortion_coefficients"]["data"],
            distortion_model=content.get("distortion_model", PLUMB_BOB),
            roi=(x, y, width, height),
            binning=int(content.get("binning", 1)),
        )
    except OSError as error:
        raise CalibrationError(f"cannot read {path}: {error.strerror}") from error
    except YamlTextError as error:
        raise CalibrationError(f"{path} is not YAML: {error}") from error
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise CalibrationError(f"{path} is not a camera file: {error!r} is missing") from error
    except ValueError as error:
        raise CalibrationError(f"{path}: {error}") from error


def _matrix(values: FloatArray) -> dict[str, Any]:
    return {
        "rows": values.shape[0],
        "cols": values.shape[1],
        "data": [float(value) for value in values.ravel()],
    }
