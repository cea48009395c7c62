"""Made-up point clouds and lines: what was promised, or a MessageError and nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up import any_float, fuzzed, small, stamps, taken, uint32, wired
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from visualization_msgs.msg import Marker

from winding_core.markers import CABLE_DTYPE, CORRECTED_DTYPE, MARKER_DTYPE
from winding_ros.messages.clouds import (
    decode_cloud,
    decode_line_width,
    encode_cloud,
    encode_line_strip,
)

pytestmark = pytest.mark.slow


fields = st.lists(
    st.builds(
        PointField,
        name=st.sampled_from([*(MARKER_DTYPE.names or ()), "extra"]),
        offset=uint32,
        datatype=st.integers(0, 9),
        count=small,
    ),
    max_size=12,
)


@fuzzed
@given(
    fields=fields,
    shape=st.tuples(uint32, uint32, uint32, uint32),
    data=st.binary(max_size=300),
    big=st.booleans(),
)
def test_clouds_of_anything(
    fields: list[PointField], shape: tuple[int, int, int, int], data: bytes, big: bool
) -> None:
    message = PointCloud2(
        fields=fields,
        height=shape[0],
        width=shape[1],
        point_step=shape[2],
        row_step=shape[3],
        is_bigendian=big,
    )
    message._data = np.frombuffer(data, dtype=np.uint8)
    taken(lambda cloud: decode_cloud(cloud, MARKER_DTYPE), message)


@pytest.mark.parametrize("dtype", [MARKER_DTYPE, CORRECTED_DTYPE, CABLE_DTYPE])
@fuzzed
@given(
    offsets=st.lists(uint32, min_size=14, max_size=14),
    step=uint32,
    width=uint32,
    length=st.integers(0, 400),
)
def test_clouds_that_lie_about_their_shape(
    dtype: np.dtype[np.void], offsets: list[int], step: int, width: int, length: int
) -> None:
    message = wired(encode_cloud(0.0, np.zeros(3, dtype=dtype)), PointCloud2)
    for field, offset in zip(message.fields, offsets, strict=False):
        field.offset = offset
    message.point_step, message.width = step, width
    message._data = np.zeros(length, dtype=np.uint8)
    for cloud in (message, serialize_message(message)):
        read = taken(lambda cloud: decode_cloud(cloud, dtype), cloud)
        assert read is None or len(read[1]) * step == length


@pytest.mark.parametrize("dtype", [MARKER_DTYPE, CORRECTED_DTYPE, CABLE_DTYPE])
@fuzzed
@given(t=stamps, count=small, seed=small)
def test_clouds_come_back_bit_by_bit(
    dtype: np.dtype[np.void], t: float, count: int, seed: int
) -> None:
    raw = np.random.default_rng(seed).integers(0, 256, count * dtype.itemsize, dtype=np.uint8)
    records = raw.view(dtype)
    stamp, back = decode_cloud(encode_cloud(t, records), dtype)
    assert stamp == t
    for name in dtype.names or ():
        # Among the made-up bytes are NaNs.
        assert back[name].tobytes() == records[name].tobytes()


@fuzzed
@given(t=stamps, width=any_float)
def test_width_of_a_line_comes_back_when_it_is_one(t: float, width: float) -> None:
    read = taken(decode_line_width, wired(encode_line_strip(t, np.zeros((2, 3)), width), Marker))
    assert (read is None) != (0.0 < width < np.inf)
    assert read is None or read == (t, width)
