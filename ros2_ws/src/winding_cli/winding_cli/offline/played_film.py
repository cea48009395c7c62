"""A film as a camera's driver publishes it: what is due when, and which frames were late."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from marker_tracker_node.camera.image_formats import (
    FileImage,
    PixelReader,
    RawImage,
    compressed,
    encoded,
)
from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.camera.recordings import Motion
from winding_core.machine.readings import AxisReading, ImageWindow
from winding_core.raw_image import BGR8
from winding_core.units import MILLISECOND
from winding_recorder.playback.player import Pacing
from winding_ros import topics
from winding_ros.messages.camera import (
    CameraReading,
    camera_info_template,
    encode_compressed,
    encode_picture,
)
from winding_ros.messages.rig import encode_joint_state
from winding_ros.topic import Topic

Picture = RawImage | FileImage
_LISTED = 5  # So many late frames are listed


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """How a camera delivers its frames."""

    encoding: str = ""  # Of the pixels; empty for that of the film
    compression: str = ""  # jpeg or png, on the compressed topic; empty for raw pictures

    @property
    def topic(self) -> Topic:
        """Topic of the frames."""
        return topics.PREVIEW if self.compression else topics.IMAGE

    def of(self, picture: Picture) -> Picture:
        """Return a picture of a film as the camera delivers it.

        Grey pictures are a mosaic where the encoding is one, and are delivered as they are.

        Raises:
            ImageFormatError: It holds no colours, or cannot be compressed so.
        """
        grey = isinstance(picture, RawImage) and picture.encoding.startswith("mono")
        if isinstance(picture, RawImage) and grey and self.encoding.startswith("bayer"):
            picture = picture._replace(encoding=self.encoding)
        elif self.encoding or (isinstance(picture, FileImage) and not self.compression):
            picture = encoded(PixelReader().frame(picture), self.encoding or BGR8)
        if self.compression and isinstance(picture, RawImage):
            picture = compressed(picture, self.compression)
        return picture


@dataclass(frozen=True, kw_only=True)
class Due:
    """A message that is due."""

    t: float  # When, by the film's times [s]
    topic: Topic  # On which
    message: Any  # Message, or its CDR bytes
    frame: int = 0  # Number of the frame, from 1; 0 for other messages


def due_messages(
    film: Iterable[tuple[float, Picture]],
    camera: PinholeCamera,
    motion: Motion | None,
    delivery: Delivery,
) -> Iterator[Due]:
    """Yield the messages of a film: calibration and frame with one stamp, encoder readings between.

    A reading comes before the frame of its stamp. Those before the first frame are due with it,
    and one behind the last frame is the last message.

    Args:
        film: Time [s] and picture of each frame, as recorded.
        camera: Lens, window and binning.
        motion: Encoder readings; None for a camera alone.
        delivery: How the frames are delivered.

    Raises:
        ImageFormatError: A picture cannot be delivered so.
    """
    info = camera_info_template(_reading_of(camera))
    readings = deque(_readings(motion))
    begin, t = math.nan, math.nan
    for number, (t, picture) in enumerate(film, start=1):
        begin = t if number == 1 else begin
        while readings and readings[0][0] <= t:
            yield _reading(readings.popleft(), begin)
        yield Due(t=t, topic=topics.CAMERA_INFO, message=bytes(info.stamped(t)))
        sent = delivery.of(picture)
        encode: Any = encode_picture if isinstance(sent, RawImage) else encode_compressed
        yield Due(t=t, topic=delivery.topic, message=encode(t, sent), frame=number)
    if readings and math.isfinite(t):
        yield _reading(readings.popleft(), begin)


def _readings(motion: Motion | None) -> Iterator[tuple[float, float, float]]:
    if motion is not None:
        yield from zip(*(values.tolist() for values in vars(motion).values()), strict=True)


def _reading(row: tuple[float, float, float], begin: float) -> Due:
    t, angle, guide = row
    state = encode_joint_state(t, AxisReading.of_positions(angle, guide))
    return Due(t=max(t, begin), topic=topics.JOINT_STATES, message=state)


def _reading_of(camera: PinholeCamera) -> CameraReading:
    x, y, width, height = camera.roi
    return CameraReading(
        width=camera.width,
        height=camera.height,
        matrix=np.asarray(camera.k),
        distortion=np.asarray(camera.d),
        window=ImageWindow(
            x_offset=x, y_offset=y, width=width, height=height, binning=camera.binning
        ),
    )


@dataclass
class Played:
    """What was published so far."""

    rate: float  # Film seconds per second
    frames: int = 0  # How many
    late: list[int] = field(default_factory=list)  # Numbers of the frames that were late
    latest: float = 0.0  # How late the latest frame was [s]

    @property
    def sentence(self) -> str:
        """How many frames were published, and which of them late."""
        text = f"published {self.frames} frames, latest {self.latest / MILLISECOND:.1f} ms late"
        if not self.late:
            return text
        named = ", ".join(map(str, self.late[:_LISTED])) + ", ..." * (len(self.late) > _LISTED)
        return f"{text}; {len(self.late)} by more than a frame: {named}"


def play(
    messages: Iterable[Due],
    publish: Callable[[Topic, Any], None],
    played: Played,
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Publish messages when they are due.

    A frame is late that is published when the next one is due by the step before it.

    Args:
        messages: In their order.
        publish: Publishes a message, or its CDR bytes, on a topic.
        played: Is kept up to date.
        clock: Monotonic time [s].
        sleep: Waits [s].
    """
    pacing: Pacing | None = None
    before = -math.inf
    for due in messages:
        if pacing is None:
            pacing = Pacing(played.rate)
            pacing.start(due.t, clock())
        sleep(pacing.wait(due.t, clock()) or 0.0)
        behind = pacing.bag_time(clock()) - due.t
        publish(due.topic, due.message)
        if due.frame:
            played.frames += 1
            played.latest = max(played.latest, behind / played.rate)
            if behind > due.t - before:
                played.late.append(due.frame)
            before = due.t
