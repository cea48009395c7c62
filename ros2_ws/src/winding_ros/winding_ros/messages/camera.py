"""Camera frames and their calibration as messages, and back (REP-104)."""

from array import array
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, RegionOfInterest

from winding_core.machine.readings import ImageWindow
from winding_core.raw_image import BGR8, FileImage, ImageFormatError, RawImage
from winding_ros.messages.cdr import COUNT, CdrError, CdrReader, Template, serialised
from winding_ros.messages.serialised import MessageError, deserialised
from winding_ros.messages.stamps import decode_stamp, encode_stamp, serialised_stamp

CAMERA_FRAME = "camera_optical_frame"
DISTORTION_MODEL = "plumb_bob"


@dataclass(frozen=True, kw_only=True)
class CameraReading:
    """Content of a CameraInfo."""

    width: int  # Full-resolution sensor width [px].
    height: int  # Full-resolution sensor height [px].
    matrix: NDArray[np.float64]  # Full-resolution K, shape (3, 3) [px].
    distortion: NDArray[np.float64]  # plumb_bob k1, k2, p1, p2, k3, shape (5,).
    window: ImageWindow  # Part of the sensor that the frames show.


def encode_image(t: float, frame: NDArray[np.uint8]) -> bytes:
    """Return a BGR frame, shape (height, width, 3), as the CDR bytes of an Image stamped t [s].

    Raises:
        ValueError: It has another shape or is not uint8.
    """
    if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
        raise ValueError(f"frame must be uint8 (h, w, 3), got {frame.dtype} {frame.shape}")
    height, width, _ = frame.shape
    pixels = np.ascontiguousarray(frame)
    return encode_picture(t, RawImage(height, width, BGR8, 3 * width, False, pixels.data))


def encode_picture(t: float, picture: RawImage) -> bytes:
    """Return a picture, `step` bytes a row, as the CDR bytes of an Image stamped t [s]."""
    pixels = np.frombuffer(picture.data, dtype=np.uint8)
    return b"".join((_image_template(*picture[:5]).stamped(t), pixels.data))


@cache
def _image_template(
    height: int, width: int, encoding: str, step: int, big_endian: bool
) -> Template:
    """Return everything of an Image before its pixels, their number included."""
    message = Image(
        height=height, width=width, encoding=encoding, step=step, is_bigendian=big_endian
    )
    message.header.frame_id = CAMERA_FRAME
    # An empty picture ends with the number of its bytes.
    return Template(serialised(message)[: -COUNT.size] + COUNT.pack(step * height))


class FrameReader(Protocol):
    """What makes a frame of a picture as it came."""

    def frame(self, image: RawImage | FileImage) -> NDArray[np.uint8]:
        """Return a BGR frame, shape (height, width, 3); it raises `ImageFormatError`."""


def decode_image(
    message: bytes | Image, reader: FrameReader | None = None
) -> tuple[float, NDArray[Any]]:
    """Return (t [s], frame) of an Image or of its CDR bytes.

    The frame may not be written to: it shows the message's own bytes where those are taken as is.

    Args:
        message: The picture.
        reader: Makes the frame; None for the numbers as the encoding orders them, shape
            (height, width) or (height, width, numbers of a pixel).

    Raises:
        MessageError: No Image, an encoding without colours, or a size that does not fit the data.
    """
    if isinstance(message, bytes):
        try:
            picture = _picture(CdrReader(message))
        except CdrError:
            return decode_image(deserialised(message, Image), reader)
        return serialised_stamp(message), _frame(picture, reader)
    picture = RawImage(
        height=message.height,
        width=message.width,
        encoding=message.encoding,
        step=message.step,
        big_endian=bool(message.is_bigendian),
        data=memoryview(message.data),
    )
    return decode_stamp(message.header.stamp), _frame(picture, reader)


def _picture(reader: CdrReader) -> RawImage:
    # Stamp and frame.
    reader.skip(4, 2)
    reader.string()
    height, width = reader.u32(), reader.u32()
    encoding = reader.string()
    big_endian = bool(reader.data[reader.skip(1)])
    return RawImage(height, width, encoding, reader.u32(), big_endian, reader.octets())


def decode_compressed(data: bytes, reader: FrameReader) -> tuple[float, NDArray[np.uint8]]:
    """Return (t [s], frame) of the CDR bytes of a CompressedImage; the reader makes the frame.

    Raises:
        MessageError: They are none, or hold no picture with colours.
    """
    try:
        fields = CdrReader(data)
        # Stamp and frame.
        fields.skip(4, 2)
        fields.string()
        picture = FileImage(fields.string(), fields.octets())
    except CdrError:
        message = deserialised(data, CompressedImage)
        picture = FileImage(message.format, memoryview(message.data))
    return serialised_stamp(data), _frame(picture, reader)


def _frame(picture: RawImage | FileImage, reader: FrameReader | None) -> NDArray[Any]:
    try:
        if reader is not None:
            return reader.frame(picture)
        assert isinstance(picture, RawImage)
        return picture.numbers()
    except ImageFormatError as error:
        raise MessageError(str(error)) from error


def camera_info_template(reading: CameraReading) -> Template:
    """Return a calibration as a CameraInfo to be stamped: full-resolution K with its window."""
    return Template.of(encode_camera_info(0.0, reading))


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
    return encode_compressed(t, FileImage(f"{BGR8}; jpeg compressed {BGR8}", jpeg))


def encode_compressed(t: float, picture: FileImage) -> CompressedImage:
    """Return the file of a picture as a CompressedImage stamped t [s]."""
    message = CompressedImage(format=picture.format)
    message.header.stamp = encode_stamp(t)
    message.header.frame_id = CAMERA_FRAME
    message.data = array("B")
    message.data.frombytes(picture.data)
    return message


def decode_preview(message: CompressedImage) -> tuple[float, bytes]:
    """Return (t [s], JPEG bytes).

    Raises:
        MessageError: The picture is no JPEG.
    """
    if "jpeg" not in message.format:
        raise MessageError(f"preview must be jpeg, got format {message.format!r}")
    return decode_stamp(message.header.stamp), bytes(message.data)
