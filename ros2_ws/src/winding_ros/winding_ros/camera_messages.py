"""Camera frames and their calibration as messages, and back (REP-104)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, RegionOfInterest

from winding_core.readings import ImageWindow
from winding_ros.rig_messages import MessageError
from winding_ros.stamps import decode_stamp, encode_stamp

CAMERA_FRAME = "camera_optical_frame"
ENCODING = "bgr8"
DISTORTION_MODEL = "plumb_bob"


@dataclass(frozen=True, kw_only=True)
class CameraReading:
    """What a CameraInfo says.

    Attributes:
        width: Full-resolution sensor width [px].
        height: Full-resolution sensor height [px].
        matrix: Full-resolution K, shape (3, 3) [px].
        distortion: plumb_bob k1, k2, p1, p2, k3, shape (5,).
        window: Part of the sensor that the frames show.
    """

    width: int
    height: int
    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    window: ImageWindow


def encode_image(t: float, frame: NDArray[np.uint8]) -> Image:
    """Return a BGR frame, shape (height, width, 3), as an Image stamped t [s].

    Raises:
        ValueError: It has another shape or is not uint8.
    """
    if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
        raise ValueError(f"frame must be uint8 (h, w, 3), got {frame.dtype} {frame.shape}")
    message = Image(
        height=frame.shape[0],
        width=frame.shape[1],
        encoding=ENCODING,
        is_bigendian=0,
        step=frame.shape[1] * 3,
    )
    message.header.stamp = encode_stamp(t)
    message.header.frame_id = CAMERA_FRAME
    # The setter copies element by element; the serialiser takes any contiguous buffer.
    message._data = np.ascontiguousarray(frame).reshape(-1)
    return message


def decode_image(message: Image) -> tuple[float, NDArray[np.uint8]]:
    """Return (t [s], BGR frame of shape (height, width, 3)).

    Raises:
        MessageError: Another encoding, or a size that does not fit the data.
    """
    channel_order = {"bgr8": slice(None), "rgb8": slice(None, None, -1)}
    if message.encoding not in channel_order:
        raise MessageError(f"image encoding must be bgr8 or rgb8, got {message.encoding!r}")
    data = np.frombuffer(message.data, dtype=np.uint8)
    if message.step < message.width * 3 or data.size != message.step * message.height:
        raise MessageError(
            f"image of {message.width} x {message.height} with step {message.step} needs "
            f"{message.step * message.height} bytes, got {data.size}"
        )
    rows = data.reshape(message.height, message.step)[:, : message.width * 3]
    frame = rows.reshape(message.height, message.width, 3)[:, :, channel_order[message.encoding]]
    return decode_stamp(message.header.stamp), np.ascontiguousarray(frame)


def encode_camera_info(t: float, reading: CameraReading) -> CameraInfo:
    """Return a calibration as a CameraInfo stamped t [s]: full-resolution K with its window."""
    window = reading.window
    message = CameraInfo(
        height=reading.height,
        width=reading.width,
        distortion_model=DISTORTION_MODEL,
        d=[float(value) for value in reading.distortion],
        k=np.asarray(reading.matrix, dtype=float).reshape(9),
        r=np.eye(3).reshape(9),
        p=np.hstack([reading.matrix, np.zeros((3, 1))]).reshape(12),
        binning_x=window.binning,
        binning_y=window.binning,
        roi=RegionOfInterest(
            x_offset=window.x_offset,
            y_offset=window.y_offset,
            width=window.width,
            height=window.height,
            do_rectify=False,
        ),
    )
    message.header.stamp = encode_stamp(t)
    message.header.frame_id = CAMERA_FRAME
    return message


def decode_camera_info(message: CameraInfo) -> tuple[float, CameraReading]:
    """Return (t [s], calibration).

    Raises:
        MessageError: The camera is not calibrated (K[0] = 0), or its model is not plumb_bob.
    """
    if message.k[0] == 0.0:
        raise MessageError("camera is not calibrated: camera_info has K[0] = 0")
    if message.distortion_model != DISTORTION_MODEL:
        raise MessageError(
            f"distortion model must be {DISTORTION_MODEL}, got {message.distortion_model!r}"
        )
    if message.binning_x != message.binning_y:
        raise MessageError(
            f"binning must be equal both ways, got {message.binning_x} x {message.binning_y}"
        )
    if len(message.d) > 5:
        raise MessageError(f"{DISTORTION_MODEL} has 5 coefficients, got {len(message.d)}")
    distortion = np.zeros(5)
    distortion[: len(message.d)] = message.d
    roi = message.roi
    reading = CameraReading(
        width=message.width,
        height=message.height,
        matrix=np.array(message.k, dtype=float).reshape(3, 3),
        distortion=distortion,
        window=ImageWindow(
            x_offset=roi.x_offset,
            y_offset=roi.y_offset,
            width=roi.width,
            height=roi.height,
            # REP-104: binning 0 means the same as 1.
            binning=max(1, message.binning_x),
        ),
    )
    return decode_stamp(message.header.stamp), reading


def encode_preview(t: float, jpeg: bytes) -> CompressedImage:
    """Return a JPEG picture as a CompressedImage stamped t [s]."""
    message = CompressedImage(format=f"{ENCODING}; jpeg compressed {ENCODING}")
    message.header.stamp = encode_stamp(t)
    message.header.frame_id = CAMERA_FRAME
    message._data = np.frombuffer(jpeg, dtype=np.uint8)
    return message


def decode_preview(message: CompressedImage) -> tuple[float, bytes]:
    """Return (t [s], JPEG bytes).

    Raises:
        MessageError: The picture is no JPEG.
    """
    if "jpeg" not in message.format:
        raise MessageError(f"preview must be jpeg, got format {message.format!r}")
    return decode_stamp(message.header.stamp), bytes(message.data)
