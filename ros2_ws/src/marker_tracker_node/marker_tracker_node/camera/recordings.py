"""Recorded frames and motion: image folders, video files, bags; and the file of measurements."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from marker_tracker_node.camera.pinhole import PinholeCamera
from winding_core.markers import Markers

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
MOTION_COLUMNS = ("t", "cylinder_angle", "guide_z")
MEASURED = ("theta", "z", "s", "sigma_theta", "sigma_z")


class RecordingError(ValueError):
    """A recording cannot be read."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Encoder readings of a run.

    Attributes:
        t: Ascending times [s], shape (k,).
        cylinder_angle: [rad], shape (k,).
        guide_z: [m], shape (k,).
    """

    t: FloatArray
    cylinder_angle: FloatArray
    guide_z: FloatArray

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if not np.isfinite(values).all():
                raise RecordingError(f"{name} of a motion must be finite")
        if self.t.size < 1 or not (np.diff(self.t) > 0.0).all():
            raise RecordingError(f"motion times must ascend, got {self.t.size} of them")

    def at(self, t: float) -> tuple[float | None, float | None]:
        """Return cylinder angle and guide position at a time, or None outside the readings."""
        if not self.t[0] <= t <= self.t[-1]:
            return None, None
        return (
            float(np.interp(t, self.t, self.cylinder_angle)),
            float(np.interp(t, self.t, self.guide_z)),
        )


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A bag's content.

    Attributes:
        camera: Of the frames; None if the bag has no CameraInfo.
        motion: Encoder readings; None if the bag has no JointState.
    """

    camera: PinholeCamera | None
    motion: Motion | None


def read_motion(path: Path) -> Motion:
    """Read a CSV with the columns t, cylinder_angle, guide_z (SI).

    Raises:
        RecordingError: The file cannot be read or lacks a column.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        columns = [np.array([float(row[name]) for row in rows]) for name in MOTION_COLUMNS]
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from error
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        raise RecordingError(
            f"{path} must have the columns {', '.join(MOTION_COLUMNS)} with numbers: {error!r}"
        ) from error
    return Motion(t=columns[0], cylinder_angle=columns[1], guide_z=columns[2])


def folder_frames(folder: Path, fps: float | None) -> Iterator[tuple[float, ByteArray]]:
    """Yield time and frame of every picture of a folder, in the order of their names.

    Times come from frames.csv (columns file, t) if the folder has one, otherwise from the rate.

    Raises:
        RecordingError: There is no picture, no time, or a picture cannot be read.
    """
    index = folder / "frames.csv"
    if index.exists():
        listed = _listed(index)
    else:
        if fps is None:
            raise RecordingError(f"{folder} has no frames.csv: give the frame rate")
        names = sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURES)
        listed = [(path, k / fps) for k, path in enumerate(names)]
    if not listed:
        raise RecordingError(f"{folder} holds no picture")
    for path, t in listed:
        yield t, read_picture(path)


def _listed(index: Path) -> list[tuple[Path, float]]:
    try:
        with index.open(encoding="utf-8", newline="") as file:
            listed = [(index.parent / row["file"], float(row["t"])) for row in csv.DictReader(file)]
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        raise RecordingError(f"{index} must have the columns file and t: {error!r}") from error
    if not all(math.isfinite(t) for _, t in listed):
        raise RecordingError(f"{index} must have finite times")
    return listed


def read_picture(path: Path) -> ByteArray:
    """Return a picture, blue-green-red.

    Raises:
        RecordingError: It cannot be read.
    """
    frame = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if frame is None:
        raise RecordingError(f"{path} is not a picture")
    return np.asarray(frame, dtype=np.uint8)


def video_frames(path: Path, fps: float | None) -> Iterator[tuple[float, ByteArray]]:
    """Yield time and frame of a video file.

    Args:
        path: The file.
        fps: Frames per second of the camera; None to believe the file.

    Raises:
        RecordingError: OpenCV cannot read it.
    """
    video = cv2.VideoCapture(str(path))
    rate = fps or video.get(cv2.CAP_PROP_FPS)
    if not video.isOpened() or not rate > 0.0:
        raise RecordingError(f"{path} is not a video")
    number = 0
    try:
        while True:
            read, frame = video.read()
            if not read:
                break
            yield number / rate, np.asarray(frame, dtype=np.uint8)
            number += 1
    finally:
        video.release()
    if number == 0:
        raise RecordingError(f"{path} holds no frame")


def read_bag(path: Path) -> Recording:
    """Read camera and motion of a bag, whatever its topics are called.

    Raises:
        RecordingError: It cannot be read.
    """
    camera: PinholeCamera | None = None
    readings: list[tuple[float, float, float]] = []
    for kind, t, message in _messages(path, ("CameraInfo", "JointState")):
        if kind == "CameraInfo" and camera is None:
            camera = _camera_of(message)
        elif kind == "JointState" and "cylinder_joint" in message.name and len(message.position):
            place = dict(zip(message.name, message.position, strict=False))
            readings.append((t, place["cylinder_joint"], place.get("carriage_joint", math.nan)))
    # Set points have the same type and joints as readings; the stream with most samples counts.
    ordered = sorted({row[0]: row for row in readings}.values())
    motion = None
    if ordered:
        columns = np.array(ordered).T
        motion = Motion(t=columns[0], cylinder_angle=columns[1], guide_z=columns[2])
    return Recording(camera=camera, motion=motion)


def bag_frames(path: Path) -> Iterator[tuple[float, ByteArray]]:
    """Yield time and frame of every Image of a bag.

    Raises:
        RecordingError: It cannot be read, or an image is not bgr8, rgb8 or mono8.
    """
    for _, t, message in _messages(path, ("Image",)):
        channels = {"bgr8": 3, "rgb8": 3, "mono8": 1}.get(message.encoding)
        if channels is None:
            raise RecordingError(f"{path}: encoding {message.encoding!r} is not supported")
        rows = np.asarray(message.data, dtype=np.uint8).reshape(message.height, message.step)
        frame = rows[:, : message.width * channels].reshape(message.height, message.width, channels)
        if message.encoding == "rgb8":
            frame = frame[..., ::-1]
        yield t, np.ascontiguousarray(np.broadcast_to(frame, (*frame.shape[:2], 3)))


def write_measurements(path: Path, rows: list[tuple[float, Markers]]) -> None:
    """Write one line per frame and marker: t, id, theta, z, s, sigma_theta, sigma_z, flags."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "id", *MEASURED, "flags"])
        for t, markers in rows:
            for marker in markers:
                numbers = [f"{float(marker[name]):.9g}" for name in MEASURED]
                writer.writerow([f"{t:.9f}", int(marker["id"]), *numbers, int(marker["flags"])])


def _messages(path: Path, kinds: tuple[str, ...]) -> Iterator[tuple[str, float, Any]]:
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            wanted = [
                link for link in reader.connections if link.msgtype.rsplit("/", 1)[-1] in kinds
            ]
            for link, _, raw in reader.messages(connections=_busiest(wanted)):
                message: Any = reader.deserialize(raw, link.msgtype)
                stamp = message.header.stamp
                yield link.msgtype.rsplit("/", 1)[-1], stamp.sec + 1e-9 * stamp.nanosec, message
    except (AnyReaderError, OSError) as error:
        raise RecordingError(f"cannot read {path}: {error}") from error


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
        return PinholeCamera.from_info(
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
