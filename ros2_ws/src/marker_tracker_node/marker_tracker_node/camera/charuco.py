"""ChArUco boards by OpenCV: the interface since its version 4.7, and the one of Ubuntu's 4.6."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.arrays import ByteArray, FloatArray

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
