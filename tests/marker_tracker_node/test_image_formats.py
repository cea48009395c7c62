"""Frames written as a camera writes them, raw and compressed, and read again."""

import numpy as np
import pytest

from marker_tracker_node.camera.image_formats import (
    ENCODINGS,
    FileImage,
    ImageFormatError,
    PixelReader,
    compressed,
    encoded,
)
from marker_tracker_node.ros.message_handler import TrackerHandler
from marker_tracker_node.ros.parameters import TrackerParameters
from winding_ros import graph, topics
from winding_ros.messages.camera import decode_compressed, encode_compressed
from winding_ros.messages.cdr import serialised
from winding_ros.messages.serialised import MessageError


def picture(encoding: str = "") -> np.ndarray:
    """Random colours; for a mosaic each channel is one number, which interpolation keeps."""
    rng = np.random.default_rng(3)
    shape = (1, 1, 3) if encoding.startswith("bayer") else (12, 18, 3)
    return np.broadcast_to(rng.integers(0, 256, shape, dtype=np.uint8), (12, 18, 3))


@pytest.mark.parametrize("compression", ["", "png"])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_what_a_camera_writes_is_read_again(encoding: str, compression: str) -> None:
    image = encoded(picture(encoding), encoding)
    sent = compressed(image, compression) if compression else image
    np.testing.assert_array_equal(PixelReader().frame(sent), picture(encoding))


def test_jpeg_keeps_colours_through_a_message() -> None:
    frame = np.full((16, 24, 3), (25, 185, 225), dtype=np.uint8)
    data = serialised(encode_compressed(1.5, compressed(encoded(frame, "rgb8"), "jpeg")))
    t, read = decode_compressed(data, PixelReader())
    assert t == 1.5
    # JPEG of one colour is within its quantisation of the mean.
    np.testing.assert_allclose(read.astype(int), frame, atol=3)


def test_a_mosaic_without_a_declared_pattern_takes_the_configured_one() -> None:
    image = compressed(encoded(picture("bayer_gbrg8"), "bayer_gbrg8"), "png")
    bare = FileImage("png", image.data)
    with pytest.raises(ImageFormatError, match="'mono8' holds no colour"):
        PixelReader().frame(bare)
    read = PixelReader(encoding="bayer_gbrg8").frame(bare)
    np.testing.assert_array_equal(read, picture("bayer_gbrg8"))


def test_jpeg_of_sixteen_bits_is_refused() -> None:
    with pytest.raises(ImageFormatError, match="JPEG holds 8 bits, and bgr16 has 16: use png"):
        compressed(encoded(picture(), "bgr16"), "jpeg")


@pytest.mark.parametrize("data", [b"", b"no picture", b"\x89PNG\r\n\x1a\n"])
def test_a_compressed_frame_that_is_none_is_refused_live(data: bytes) -> None:
    handler = TrackerHandler(TrackerParameters(case=4, measure_lay=False))
    message = serialised(encode_compressed(0.0, FileImage("jpeg", data)))
    with pytest.raises(MessageError, match=f"{len(data)} bytes of format 'jpeg' are no picture"):
        list(handler.take(topics.PREVIEW, message))


def test_the_graph_of_compressed_frames_has_no_raw_ones() -> None:
    (tracker,) = (s for s in graph.compressed(graph.GRAPH) if s.name == graph.TRACKER.name)
    assert topics.PREVIEW in tracker.subscribes
    assert topics.IMAGE not in tracker.subscribes
    assert tracker.command == ("-m", "marker_tracker_node", "--compressed")
