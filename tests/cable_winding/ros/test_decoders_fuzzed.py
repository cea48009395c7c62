"""Made-up messages: a decoder gives numbers or MessageError, and nothing else."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState, PointCloud2, PointField
from visualization_msgs.msg import Marker

from cable_winding.markers import CABLE_DTYPE, CORRECTED_DTYPE, MARKER_DTYPE
from cable_winding.ros.camera_messages import decode_camera_info, decode_image, decode_preview
from cable_winding.ros.cloud_messages import decode_cloud, decode_line_strip, encode_cloud
from cable_winding.ros.diagnostic_messages import decode_case_votes, decode_diagnostics
from cable_winding.ros.rig_messages import MessageError, decode_joint_state, decode_tension
from cable_winding.ros.stamps import serialised_stamp_ns

fuzzed = settings(max_examples=150, deadline=None)
any_float = st.floats(allow_nan=True, allow_infinity=True)
small = st.integers(0, 40)
uint32 = st.one_of(small, st.integers(0, 2**32 - 1))


def taken(decode: Callable[[Any], Any], message: Any) -> Any:
    """Return what a decoder makes of a message, or None when it refuses it."""
    try:
        return decode(message)
    except MessageError:
        return None


@fuzzed
@given(
    names=st.lists(st.sampled_from(["cylinder_joint", "carriage_joint", "", "x"]), max_size=4),
    position=st.lists(any_float, max_size=4),
    velocity=st.lists(any_float, max_size=4),
)
def test_joint_states(names: list[str], position: list[float], velocity: list[float]) -> None:
    read = taken(decode_joint_state, JointState(name=names, position=position, velocity=velocity))
    if read is not None:
        assert np.isfinite(
            [read[1].cylinder_angle, read[1].carriage_position, read[1].angular_speed]
        ).all()


@fuzzed
@given(force=any_float)
def test_tension(force: float) -> None:
    message = WrenchStamped()
    message.wrench.force.x = force
    read = taken(decode_tension, message)
    assert (read is None) is not np.isfinite(force)


@fuzzed
@given(
    size=st.tuples(uint32, uint32, uint32),
    encoding=st.sampled_from(["bgr8", "rgb8", "mono8", ""]),
    data=st.binary(max_size=300),
)
def test_images(size: tuple[int, int, int], encoding: str, data: bytes) -> None:
    height, width, step = size
    message = Image(height=height, width=width, step=step, encoding=encoding)
    message._data = np.frombuffer(data, dtype=np.uint8)
    read = taken(decode_image, message)
    if read is not None:
        assert read[1].shape == (height, width, 3)


@fuzzed
@given(
    k=st.lists(any_float, min_size=9, max_size=9),
    d=st.lists(any_float, max_size=14),
    binning=st.tuples(uint32, uint32),
    model=st.sampled_from(["plumb_bob", "equidistant", ""]),
)
def test_camera_info(k: list[float], d: list[float], binning: tuple[int, int], model: str) -> None:
    message = CameraInfo(
        k=np.array(k), d=d, binning_x=binning[0], binning_y=binning[1], distortion_model=model
    )
    taken(decode_camera_info, message)


@fuzzed
@given(form=st.text(max_size=20), data=st.binary(max_size=50))
def test_previews(form: str, data: bytes) -> None:
    message = CompressedImage(format=form)
    message._data = np.frombuffer(data, dtype=np.uint8)
    taken(decode_preview, message)


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
    shape=st.tuples(uint32, uint32, uint32),
    data=st.binary(max_size=300),
    big=st.booleans(),
)
def test_clouds_of_anything(
    fields: list[PointField], shape: tuple[int, int, int], data: bytes, big: bool
) -> None:
    message = PointCloud2(
        fields=fields, height=shape[0], width=shape[1], point_step=shape[2], is_bigendian=big
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
    message = encode_cloud(0.0, np.zeros(3, dtype=dtype))
    for field, offset in zip(message.fields, offsets, strict=False):
        field.offset = offset
    message.point_step, message.width = step, width
    message._data = np.zeros(length, dtype=np.uint8)
    taken(lambda cloud: decode_cloud(cloud, dtype), message)


@fuzzed
@given(
    statuses=st.lists(
        st.builds(
            lambda level, name, pairs: DiagnosticStatus(
                level=bytes([level]),
                name=name,
                values=[KeyValue(key=key, value=value) for key, value in pairs],
            ),
            st.integers(0, 255),
            st.text(max_size=8).filter(str.isprintable),
            st.lists(
                st.tuples(
                    st.one_of(st.just("case 4"), st.text(max_size=8).filter(str.isprintable)),
                    st.one_of(st.just("0.5"), st.text(max_size=8).filter(str.isprintable)),
                ),
                max_size=3,
            ),
        ),
        max_size=3,
    )
)
def test_diagnostics(statuses: list[DiagnosticStatus]) -> None:
    message = DiagnosticArray(status=statuses)
    taken(decode_diagnostics, message)
    taken(decode_case_votes, message)


def test_a_line_without_points_is_empty() -> None:
    assert decode_line_strip(Marker())[1].shape == (0, 3)


@fuzzed
@given(data=st.binary(max_size=40))
def test_stamps_of_any_bytes(data: bytes) -> None:
    if len(data) < 12:
        with pytest.raises(ValueError, match="at least 12 bytes"):
            serialised_stamp_ns(data)
    else:
        stamp = serialised_stamp_ns(data)
        assert -(2**31) * 10**9 <= stamp < 2**31 * 10**9 + 2**32
