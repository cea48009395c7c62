"""Recorded frames, blue-green-red, with their times: folders of pictures, video files, bags."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.bags import is_bag, messages
from marker_tracker_node.camera.frame_times import FrameTimeError, FrameTimes
from marker_tracker_node.camera.image_formats import ImageFormatError, PixelReader, RawImage
from marker_tracker_node.camera.recordings import RecordingError

ByteArray = NDArray[np.uint8]

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
# A recording whose first pictures are all refused is refused.
_HOPELESS = 50
_GIVE_RATE = "give the camera's rate (--fps) to count pictures instead"


class FrameSource:
    """The frames of a recording, read once.

    Attributes:
        refused: How many pictures could not be read, by reason.
    """

    def __init__(
        self, path: Path, *, fps: float | None = None, reader: PixelReader | None = None
    ) -> None:
        """Open nothing yet.

        Args:
            path: Video file, folder of pictures, or bag.
            fps: Frames per second of the camera [1/s]. It takes the place of a video's own times,
                and is needed for pictures without any.
            reader: Knows how the camera's pixels are to be read; None to believe the recording.

        Raises:
            RecordingError: The rate is not positive and finite.
        """
        if fps is not None and not (math.isfinite(fps) and fps > 0.0):
            raise RecordingError(f"the frame rate must be positive and finite, got {fps:g}")
        self.refused: Counter[str] = Counter()
        self._path = path
        self._fps = fps
        self._reader = reader or PixelReader()
        self._times: FrameTimes | None = None
        self._fps_used = False

    def __iter__(self) -> Iterator[tuple[float, ByteArray]]:
        """Yield time [s] and frame of shape (rows, columns, 3), not to be written to.

        Raises:
            RecordingError: It cannot be read, holds no usable picture, or its times cannot be
                used.
        """
        if is_bag(self._path):
            pictures = self._bag()
        elif self._path.is_dir():
            pictures = self._folder()
        else:
            pictures = self._video()
        used = 0
        for t, picture in pictures:
            try:
                frame = self._reader.frame(picture)
            except ImageFormatError as error:
                self.refused[str(error)] += 1
                if not used and self.refused.total() >= _HOPELESS:
                    break
                continue
            used += 1
            yield t, frame
        if not used:
            reason = next(iter(self.refused), "there is none")
            raise RecordingError(f"{self._path} holds no frame that can be used: {reason}")

    def remarks(self) -> list[str]:
        """Return what is to be said of the frames read so far, in sentences."""
        said = []
        if self._times is not None:
            uneven = self._times.unevenness()
            other = self._times.contradiction(self._fps) if self._fps is not None else ""
            if other:
                said.append(f"{other}: {'those' if self._fps_used else 'its own'} are used")
            if uneven:
                what = "they are counted all the same" if self._fps_used else "their own are used"
                said.append(f"{uneven}: {what}")
        if self._reader.remark:
            said.append(self._reader.remark)
        for reason, count in self.refused.most_common(3):
            said.append(f"{count} x {reason}")
        return said

    def _video(self) -> Iterator[tuple[float, RawImage]]:
        video = cv2.VideoCapture(str(self._path))
        try:
            if not video.isOpened():
                raise RecordingError(f"{self._path} is not a video")
            # A camera's rate makes times that cannot be used good.
            self._fps_used = self._fps is not None
            self._times = FrameTimes(self._path.name, advice=_GIVE_RATE)
            number = 0
            while True:
                read, frame = video.read()
                if not read:
                    return
                t = self._time(video.get(cv2.CAP_PROP_POS_MSEC) * 1.0e-3, number)
                number += 1
                yield t, self._decoded(np.asarray(frame))
        finally:
            video.release()

    def _time(self, t: float, number: int) -> float:
        assert self._times is not None
        try:
            self._times.take(t)
        except FrameTimeError as error:
            if self._fps is None:
                raise RecordingError(str(error)) from error
        return t if self._fps is None else number / self._fps

    def _folder(self) -> Iterator[tuple[float, RawImage]]:
        index = self._path / "frames.csv"
        if index.exists():
            listed = _listed(index)
            self._times = FrameTimes(index.name)
            try:
                for _, t in listed:
                    self._times.take(t)
            except FrameTimeError as error:
                raise RecordingError(str(error)) from error
        else:
            if self._fps is None:
                raise RecordingError(f"{self._path} has no frames.csv: give the frame rate (--fps)")
            names = sorted(p for p in self._path.iterdir() if p.suffix.lower() in PICTURES)
            listed = [(path, k / self._fps) for k, path in enumerate(names)]
        if not listed:
            raise RecordingError(f"{self._path} holds no picture")
        for path, t in listed:
            frame = cv2.imread(str(path), cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)
            if frame is None:
                raise RecordingError(f"{path} is not a picture")
            yield t, self._decoded(np.asarray(frame))

    def _decoded(self, frame: NDArray[np.uint8] | NDArray[np.uint16]) -> RawImage:
        """Return what OpenCV has read as a picture that the reader may take otherwise."""
        bits = 8 * frame.dtype.itemsize
        if self._reader.encoding.startswith("bayer") and frame.ndim == 3:
            # A video or JPEG holds the mosaic as three equal channels.
            frame = frame[:, :, 0]
        rows, columns = frame.shape[:2]
        return RawImage(
            height=rows,
            width=columns,
            encoding=f"mono{bits}" if frame.ndim == 2 else f"bgr{bits}",
            step=frame.itemsize * frame.size // max(rows, 1),
            big_endian=bool(np.dtype(np.uint16).str.startswith(">")),
            data=np.ascontiguousarray(frame).reshape(-1).view(np.uint8),
        )

    def _bag(self) -> Iterator[tuple[float, RawImage]]:
        self._times = FrameTimes(f"the pictures of {self._path.name}", backwards=True)
        for _, t, message in messages(self._path, ("Image",)):
            try:
                self._times.take(t)
            except FrameTimeError as error:
                raise RecordingError(str(error)) from error
            yield (
                t,
                RawImage(
                    height=message.height,
                    width=message.width,
                    encoding=message.encoding,
                    step=message.step,
                    big_endian=bool(message.is_bigendian),
                    data=message.data,
                ),
            )


def _listed(index: Path) -> list[tuple[Path, float]]:
    try:
        with index.open(encoding="utf-8", newline="") as file:
            return [(index.parent / row["file"], float(row["t"])) for row in csv.DictReader(file)]
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        raise RecordingError(f"{index} must have the columns file and t: {error!r}") from error
