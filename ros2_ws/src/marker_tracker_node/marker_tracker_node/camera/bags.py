"""Camera, motion and pictures of a bag, whatever its topics are called."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.camera.recordings import Motion, RecordingError

BAGS = (".mcap", ".db3", ".bag")


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A bag's content.

    Attributes:
        camera: Of the frames; None if the bag has no CameraInfo.
        motion: Encoder readings; None if the bag has no JointState.
    """

    camera: PinholeCamera | None
    motion: Motion | None


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


def messages(path: Path, kinds: tuple[str, ...]) -> Iterator[tuple[str, float, Any]]:
    """Yield type, stamp [s] and message of the busiest topic of each kind.

    Raises:
        RecordingError: The bag cannot be read.
    """
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
