"""Made-up pictures and calibrations: what was promised, or a MessageError and nothing else."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up import any_float, fuzzed, number, small, stamps, taken, uint32, wired, words
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from marker_tracker_node.camera.image_formats import ENCODINGS, PixelReader
from winding_core.machine.readings import ImageWindow
from winding_ros.messages.camera import (
    CameraReading,
    decode_camera_info,
    decode_image,
    decode_preview,
    encode_camera_info,
    encode_image,
    encode_preview,
)

pytestmark = pytest.mark.slow


@fuzzed
@given(
    size=st.tuples(uint32, uint32, uint32),
    encoding=st.sampled_from([*ENCODINGS, "mono8", "32FC3", ""]),
    data=st.binary(max_size=300),
    big=st.integers(0, 1),
)
def test_images(size: tuple[int, int, int], encoding: str, data: bytes, big: int) -> None:
    height, width, step = size
    message = Image(height=height, width=width, step=step, encoding=encoding, is_bigendian=big)
    message._data = np.frombuffer(data, dtype=np.uint8)
    read = taken(partial(decode_image, reader=PixelReader()), message)
    if read is not None:
        assert encoding in ENCODINGS
        assert read[1].shape == (height, width, 3)
        assert read[1].dtype == np.uint8


@fuzzed
@given(t=stamps, rows=small, columns=small, seed=small)
def test_images_come_back_and_rows_may_be_padded(
    t: float, rows: int, columns: int, seed: int
) -> None:
    frame = np.random.default_rng(seed).integers(0, 256, (rows, columns, 3), dtype=np.uint8)
    data = encode_image(t, frame)
    assert decode_image(data)[0] == t
    assert (decode_image(data)[1] == frame).all()
    message = wired(data, Image)
    assert decode_image(message)[0] == t
    assert (decode_image(message)[1] == frame).all()
    step = 3 * columns + seed
    padded = np.zeros((rows, step), dtype=np.uint8)
    padded[:, : 3 * columns] = frame.reshape(rows, -1) if frame.size else 0
    message.step, message._data = step, padded.reshape(-1)
    assert (decode_image(message)[1] == frame).all()
    assert (decode_image(serialize_message(message))[1] == frame).all()


@fuzzed
@given(
    k=st.lists(any_float, min_size=9, max_size=9),
    d=st.lists(any_float, max_size=14),
    binning=st.tuples(uint32, uint32),
    model=st.sampled_from(["plumb_bob", "plumb_bob", "equidistant", ""]),
)
def test_camera_info(k: list[float], d: list[float], binning: tuple[int, int], model: str) -> None:
    message = CameraInfo(
        k=np.array(k), d=d, binning_x=binning[0], binning_y=binning[1], distortion_model=model
    )
    read = taken(decode_camera_info, message)
    if read is not None:
        _, reading = read
        assert reading.matrix[0, 0] != 0.0
        np.testing.assert_array_equal(reading.distortion, np.array((d + [0.0] * 5)[:5]))
        assert len(d) <= 5
        assert reading.window.binning == max(1, *binning)


@fuzzed
@given(
    t=stamps,
    k=st.lists(number, min_size=9, max_size=9).filter(lambda k: k[0] != 0.0),
    d=st.lists(number, min_size=5, max_size=5),
    window=st.tuples(uint32, uint32, uint32, uint32, st.integers(1, 100)),
)
def test_camera_info_comes_back(
    t: float, k: list[float], d: list[float], window: tuple[int, ...]
) -> None:
    x, y, width, height, binning = window
    reading = CameraReading(
        width=width,
        height=height,
        matrix=np.array(k).reshape(3, 3),
        distortion=np.array(d),
        window=ImageWindow(x_offset=x, y_offset=y, width=width, height=height, binning=binning),
    )
    stamp, back = decode_camera_info(wired(encode_camera_info(t, reading)))
    assert (stamp, back.width, back.height, back.window) == (t, width, height, reading.window)
    np.testing.assert_array_equal(back.matrix, reading.matrix)
    np.testing.assert_array_equal(back.distortion, reading.distortion)


@fuzzed
@given(form=words, data=st.binary(max_size=50), t=stamps)
def test_previews(form: str, data: bytes, t: float) -> None:
    message = CompressedImage(format=form)
    message._data = np.frombuffer(data, dtype=np.uint8)
    read = taken(decode_preview, message)
    assert read == ((0.0, data) if "jpeg" in form else None)
    assert decode_preview(encode_preview(t, data)) == (t, data)
