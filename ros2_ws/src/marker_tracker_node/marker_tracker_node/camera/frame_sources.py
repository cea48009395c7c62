"""Recorded frames with their times: folders of pictures, video files, and bags of any topics."""

import csv
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from marker_tracker_node.arrays import ByteArray
from marker_tracker_node.camera.image_formats import (
    FileImage,
    ImageFormatError,
    PixelReader,
    RawImage,
)
from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.camera.recordings import PICTURES, Motion, RecordingError
from winding_core.units import MILLISECOND

# A recording whose first pictures are all refused is refused.
_HOPELESS = 50
_GIVE_RATE = "give the camera's rate (--fps) to count pictures instead"
# Steps that differ by less are even: containers round times to milliseconds.
EVEN_SHARE = 0.1
ROUNDING = 1.001e-3
SAME_RATE = 0.005  # Rates that differ by less are the same
# So many equal times in succession are no times.
REPEATED = 3
BAGS = (".mcap", ".db3", ".bag")


class FrameSource:
    """The frames of a recording, read once."""

    def __init__(
        self, path: Path, *, fps: float | None = None, reader: PixelReader | None = None
    ) -> None:
        """Open nothing yet.

        Args:
            path: Video file, folder of pictures, or bag.
            fps: Frames per second of the camera [1/s]. It takes the place of a video's own times,
                and is needed for pictures without any.
            reader: Knows how the camera's pixels are to be read; None: as recorded.

        Raises:
            RecordingError: The rate is not positive and finite.
        """
        if fps is not None and not (math.isfinite(fps) and fps > 0.0):
            raise RecordingError(f"the frame rate must be positive and finite, got {fps:g}")
        self.refused: Counter[str] = Counter()  # How many pictures could not be read, by reason
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
        used = 0
        for t, picture in self.pictures():
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

    def pictures(self) -> Iterator[tuple[float, RawImage | FileImage]]:
        """Yield time [s] and picture as it is recorded, whether or not it can be read.

        Raises:
            RecordingError: The recording cannot be read, or its times cannot be used.
        """
        if is_bag(self._path):
            yield from self._bag()
        elif self._path.is_dir():
            yield from self._folder()
        else:
            yield from self._video()

    def remarks(self) -> list[str]:
        """Return remarks on the frames read so far, in sentences."""
        remarks = []
        if self._times is not None:
            uneven = self._times.unevenness()
            other = self._times.contradiction(self._fps) if self._fps is not None else ""
            if other:
                remarks.append(f"{other}: {'those' if self._fps_used else 'its own'} are used")
            if uneven:
                what = "they are counted all the same" if self._fps_used else "their own are used"
                remarks.append(f"{uneven}: {what}")
        if self._reader.remark:
            remarks.append(self._reader.remark)
        for reason, count in self.refused.most_common(3):
            remarks.append(f"{count} x {reason}")
        return remarks

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
                yield t, self._reader.decoded(np.asarray(frame))
        finally:
            video.release()

    def _time(self, t: float, number: int) -> float:
        assert self._times is not None
        try:
            self._times.take(t)
        except FrameTimeError:
            if self._fps is None:
                raise
        return t if self._fps is None else number / self._fps

    def _folder(self) -> Iterator[tuple[float, RawImage]]:
        index = self._path / "frames.csv"
        if index.exists():
            listed = _listed(index)
            self._times = FrameTimes(index.name)
            for _, t in listed:
                self._times.take(t)
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
            yield t, self._reader.decoded(np.asarray(frame))

    def _bag(self) -> Iterator[tuple[float, RawImage | FileImage]]:
        self._times = FrameTimes(f"the pictures of {self._path.name}", backwards=True)
        # A driver that publishes both compresses what it publishes raw.
        kinds = ("Image", "CompressedImage")
        for kind, t, message in messages(self._path, kinds, alternatives=True):
            self._times.take(t)
            if kind == "CompressedImage":
                yield t, FileImage(message.format, message.data)
                continue
            picture = RawImage(
                height=message.height,
                width=message.width,
                encoding=message.encoding,
                step=message.step,
                big_endian=bool(message.is_bigendian),
                data=message.data,
            )
            yield t, picture


def _listed(index: Path) -> list[tuple[Path, float]]:
    try:
        with index.open(encoding="utf-8", newline="") as file:
            listed = [(Path(row["file"]), float(row["t"])) for row in csv.DictReader(file)]
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        raise RecordingError(f"{index} must have the columns file and t: {error!r}") from error
    for name, _ in listed:
        if not str(name).isprintable():
            raise RecordingError(f"{index} names {str(name)!r}, which is no name of a picture")
    return [(index.parent / name, t) for name, t in listed]


class FrameTimeError(RecordingError):
    """Pictures have no times that can be used."""


class FrameTimes:
    """Times of a recording's pictures, as they come."""

    def __init__(self, owner: str, *, backwards: bool = False, advice: str = "") -> None:
        """Start without a picture.

        Args:
            owner: What the times are those of, to begin a sentence with.
            backwards: Whether single pictures may be older than the one before.
            advice: What to do when there are no times; empty where nothing can be done.
        """
        self._owner = owner
        self._backwards = backwards
        self._advice = f"; {advice}" if advice else ""
        self._times: list[float] = []

    def take(self, t: float) -> float:
        """Return the time of the next picture [s].

        Raises:
            FrameTimeError: It is no number, times run backwards, or they stand still.
        """
        times, number = self._times, len(self._times) + 1
        if not math.isfinite(t):
            raise FrameTimeError(
                f"{self._owner}: picture {number} is at {t} s, which must be finite{self._advice}"
            )
        times.append(t)
        if number >= REPEATED and len(set(times)) == 1:
            raise FrameTimeError(
                f"{self._owner}: the first {number} pictures are all at {t:g} s, and times must "
                f"ascend{self._advice}"
            )
        if number > 1 and t < times[-2] and not self._backwards:
            raise FrameTimeError(
                f"{self._owner}: picture {number} is at {t:.6f} s, before the {times[-2]:.6f} s of "
                f"the one before, and times must ascend{self._advice}"
            )
        return t

    def unevenness(self) -> str:
        """Return how unevenly the times are spaced; empty where they are not."""
        steps = self._steps()
        if not steps.size:
            return ""
        usual, low, high = float(np.median(steps)), float(steps.min()), float(steps.max())
        if high - low <= max(EVEN_SHARE * usual, min(ROUNDING, 0.5 * usual)):
            return ""
        t = np.array(self._times)
        wrong = np.abs(t - t[0] - usual * np.arange(t.size)).max()
        return (
            f"pictures are unevenly spaced: {low / MILLISECOND:.1f} to {high / MILLISECOND:.1f} ms "
            f"apart, mostly {usual / MILLISECOND:.1f} ms; counted at that rate, a picture would be "
            f"up to {wrong / MILLISECOND:.0f} ms wrong"
        )

    def contradiction(self, fps: float) -> str:
        """Return how a rate [1/s] that was given contradicts the times; empty where it does not."""
        steps = self._steps()
        rate = 1.0 / float(np.median(steps)) if steps.size else fps
        if abs(fps / rate - 1.0) <= SAME_RATE:
            return ""
        return f"{self._owner} has {rate:g} pictures a second, {fps:g} were given"

    def _steps(self) -> np.ndarray:
        steps = np.diff(np.array(self._times))
        return np.asarray(steps[steps > 0.0])


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A bag's content."""

    camera: PinholeCamera | None  # Of the frames; None if the bag has no CameraInfo
    motion: Motion | None  # Encoder readings; None if the bag has no JointState


def is_bag(path: Path) -> bool:
    """Return whether a path looks like a bag."""
    return path.suffix in BAGS or (path / "metadata.yaml").exists()


def read_bag(path: Path) -> Recording:
    """Read camera and motion of a bag, whatever its topics are called.

    Raises:
        RecordingError: It cannot be read.
    """
    camera: PinholeCamera | None = None
    readings: list[tuple[float, float, float]] = []
    for kind, t, message in messages(path, ("CameraInfo", "JointState")):
        if kind == "CameraInfo" and camera is None:
            camera = _camera_of(message)
        elif kind == "JointState":
            place = dict(zip(message.name, message.position, strict=False))
            if "cylinder_joint" in place:
                angle = place["cylinder_joint"]
                readings.append((t, angle, place.get("carriage_joint", math.nan)))
    # Set points have the same type and joints as readings; the stream with most samples counts.
    ordered = sorted({row[0]: row for row in readings}.values())
    motion = None
    if ordered:
        columns = np.array(ordered).T
        motion = Motion(t=columns[0], cylinder_angle=columns[1], guide_z=columns[2])
    return Recording(camera=camera, motion=motion)


def messages(
    path: Path, kinds: tuple[str, ...], *, alternatives: bool = False
) -> Iterator[tuple[str, float, Any]]:
    """Yield type, stamp [s] and message of the busiest topic of each kind.

    Args:
        path: The bag.
        kinds: Message types without their package.
        alternatives: Whether the first kind of which there is a message is wanted alone.

    Raises:
        RecordingError: The bag cannot be read.
    """
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            wanted = [link for link in reader.connections if _kind(link) in kinds]
            if alternatives:
                there = {_kind(link) for link in wanted if link.msgcount}
                first = next((kind for kind in kinds if kind in there), "")
                wanted = [link for link in wanted if _kind(link) == first]
            for link, _, raw in reader.messages(connections=_busiest(wanted)):
                message: Any = reader.deserialize(raw, link.msgtype)
                stamp = message.header.stamp
                yield _kind(link), stamp.sec + 1e-9 * stamp.nanosec, message
    except Exception as error:
        # The reader has no closed list of what it raises on damaged bytes.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RecordingError(f"cannot read {path}: {reason}") from error


def _kind(link: Any) -> str:
    return str(link.msgtype.rsplit("/", 1)[-1])


def _busiest(links: list[Any]) -> list[Any]:
    """Keep of every message type the topic with most messages."""
    best: dict[str, Any] = {}
    for link in links:
        kept = best.get(link.msgtype)
        if kept is None or link.msgcount > kept.msgcount:
            best[link.msgtype] = link
    return list(best.values())


def _camera_of(message: Any) -> PinholeCamera:
    roi = message.roi
    try:
        return PinholeCamera(
            width=message.width,
            height=message.height,
            k=message.k,
            d=message.d,
            roi=(roi.x_offset, roi.y_offset, roi.width, roi.height),
            binning=max(int(message.binning_x), 1),
            distortion_model=message.distortion_model or "plumb_bob",
        )
    except ValueError as error:
        raise RecordingError(f"the bag's camera_info: {error}") from error
