"""Made-up messages and changed bytes: what was promised, or a MessageError and nothing else."""

import math
from array import array
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from made_up import (
    AXES,
    any_float,
    data_of,
    fuzzed,
    number,
    small,
    stamps,
    taken,
    uint32,
    wired,
    words,
)
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState, PointCloud2, PointField
from visualization_msgs.msg import Marker

from marker_tracker_node.camera.image_formats import ENCODINGS, PixelReader
from winding_core.cable.material_report import MaterialReport
from winding_core.machine.axes import MachineAxes
from winding_core.machine.readings import AxisReading, ImageWindow
from winding_core.markers import CABLE_DTYPE, CORRECTED_DTYPE, MARKER_DTYPE
from winding_core.status import Level, Status
from winding_ros import topics
from winding_ros.message_guard import StampError
from winding_ros.messages.camera import (
    CameraReading,
    decode_camera_info,
    decode_image,
    decode_preview,
    encode_camera_info,
    encode_image,
    encode_preview,
)
from winding_ros.messages.cdr import serialised
from winding_ros.messages.clouds import (
    decode_cloud,
    decode_line_width,
    encode_cloud,
    encode_line_strip,
)
from winding_ros.messages.diagnostics import (
    NAME,
    decode_case_votes,
    decode_diagnostics,
    decode_material,
    encode_case_votes,
    encode_diagnostics,
    encode_material,
)
from winding_ros.messages.rig import (
    JointStateReader,
    decode_joint_state,
    decode_tension,
    encode_joint_state,
    encode_tension,
)
from winding_ros.messages.serialised import deserialised
from winding_ros.messages.stamps import decode_stamp, encode_stamp, serialised_stamp_ns
from winding_ros.topic import Topic

pytestmark = pytest.mark.slow
keys = st.one_of(
    words, st.sampled_from(["case 4", "case x", "law", "young", "markers", "taken_up"])
)
values = st.one_of(words, st.sampled_from(["0.5", "nan", "1e999", "-1", "1 2", "9" * 5000]))
statuses = st.lists(
    st.builds(
        lambda level, name, pairs: DiagnosticStatus(
            level=bytes([level]),
            name=name,
            values=[KeyValue(key=key, value=value) for key, value in pairs],
        ),
        st.one_of(st.integers(0, 3), st.integers(0, 255)),
        st.one_of(words, st.just(NAME)),
        st.lists(st.tuples(keys, values), max_size=7),
    ),
    max_size=2,
)
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
    names=st.lists(st.sampled_from(["cylinder_joint", "carriage_joint", "", "x"]), max_size=4),
    position=st.lists(any_float, max_size=4),
    velocity=st.lists(any_float, max_size=4),
)
def test_joint_states(names: list[str], position: list[float], velocity: list[float]) -> None:
    read = taken(decode_joint_state, JointState(name=names, position=position, velocity=velocity))
    if read is not None:
        _, reading = read
        assert np.isfinite(list(vars(reading).values())).all()
        assert reading.cylinder_angle == position[names.index("cylinder_joint")]
        assert reading.feed_speed == velocity[names.index("carriage_joint")]


@fuzzed
@given(t=stamps, reading=st.builds(AxisReading, **dict.fromkeys(AXES, number)))
def test_joint_states_come_back(t: float, reading: AxisReading) -> None:
    assert decode_joint_state(wired(encode_joint_state(t, reading), JointState)) == (t, reading)


@fuzzed
@given(t=stamps, force=any_float)
def test_tension(t: float, force: float) -> None:
    data = encode_tension(t, force)
    for message in (data, wired(data, WrenchStamped)):
        assert taken(decode_tension, message) == ((t, force) if math.isfinite(force) else None)


@fuzzed
@given(data=st.binary(max_size=40))
def test_stamps_of_any_bytes(data: bytes) -> None:
    if len(data) < 12:
        with pytest.raises(StampError, match="at least 12 bytes"):
            serialised_stamp_ns(data)
    else:
        stamp = serialised_stamp_ns(data)
        assert -(2**31) * 10**9 <= stamp < 2**31 * 10**9 + 2**32


@fuzzed
@given(nanoseconds=st.integers(-(2**52), 2**52))
def test_stamps_come_back(nanoseconds: int) -> None:
    data = encode_tension(nanoseconds * 1e-9, 0.0)
    assert serialised_stamp_ns(data) == pytest.approx(nanoseconds, abs=1)
    message = wired(data, WrenchStamped)
    again = encode_stamp(decode_stamp(message.header.stamp))
    assert (
        abs(again.nanosec - message.header.stamp.nanosec) <= 1
        or again.sec != message.header.stamp.sec
    )


@fuzzed
@given(statuses=statuses)
def test_diagnostics(statuses: list[DiagnosticStatus]) -> None:
    message = wired(DiagnosticArray(status=statuses))
    read = taken(decode_diagnostics, message)
    if read is not None:
        assert {status.level for status in read[1]} <= set(Level)
    votes = taken(decode_case_votes, message)
    if votes is not None:
        assert all(0.0 <= share <= 1.0 for share in votes[1].values())
    taken(decode_material, message)


@fuzzed
@given(
    t=stamps,
    reported=st.lists(
        st.builds(
            Status,
            name=words,
            level=st.sampled_from(Level),
            message=words,
            values=st.dictionaries(words, words, max_size=3),
        ),
        max_size=3,
    ),
)
def test_diagnostics_come_back(t: float, reported: list[Status]) -> None:
    assert decode_diagnostics(wired(encode_diagnostics(t, reported))) == (t, tuple(reported))


@fuzzed
@given(votes=st.dictionaries(st.integers(1, 12), st.integers(0, 10**6).map(lambda k: k / 10**6)))
def test_votes_come_back_best_first(votes: dict[int, float]) -> None:
    _, back = decode_case_votes(encode_case_votes(1.0, votes))
    assert back == votes
    assert list(back.values()) == sorted(votes.values(), reverse=True)


reports = st.builds(
    MaterialReport,
    law=st.just("linear"),
    markers=st.lists(st.integers(0, 9), max_size=4).map(tuple),
    taken_up=st.booleans(),
    refusal=words,
    **dict.fromkeys(("young", "standard_error", "half_width_90", "worst_share"), any_float),
)


@fuzzed
@given(report=reports)
def test_materials_come_back(report: MaterialReport) -> None:
    _, back = decode_material(wired(encode_material(1.0, report)))
    # Unlike nan, its text is equal to itself.
    assert repr(back) == repr(report)


sizes = dict.fromkeys(("height", "width", "point_step", "row_step"), uint32)


@fuzzed
@given(
    st.builds(PointCloud2, fields=fields, data=data_of(300), is_bigendian=st.booleans(), **sizes)
)
def test_clouds_of_anything(message: PointCloud2) -> None:
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
    message.data = array("B", bytes(length))
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


pictures = st.builds(
    Image,
    encoding=st.sampled_from([*ENCODINGS, "mono8", "32FC3", ""]),
    data=data_of(300),
    is_bigendian=st.integers(0, 1),
    **dict.fromkeys(("height", "width", "step"), uint32),
)


@fuzzed
@given(pictures)
def test_images(message: Image) -> None:
    read = taken(partial(decode_image, reader=PixelReader()), message)
    if read is not None:
        assert message.encoding in ENCODINGS
        assert read[1].shape == (message.height, message.width, 3)
        assert read[1].dtype == np.uint8


@fuzzed
@given(t=stamps, rows=small, columns=small, seed=small)
def test_images_come_back_padded_or_not(t: float, rows: int, columns: int, seed: int) -> None:
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
    message.step, message.data = step, array("B", padded.tobytes())
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
    message.data = array("B", data)
    assert taken(decode_preview, message) == ((0.0, data) if "jpeg" in form else None)
    assert decode_preview(encode_preview(t, data)) == (t, data)


def example(topic: Topic) -> Any:
    """Return a message of a topic with something in every list."""
    message = topic.type()
    for name, kind in topic.type.get_fields_and_field_types().items():
        if kind == "sequence<string>":
            setattr(message, name, ["cylinder_joint", "carriage_joint"])
        elif kind == "sequence<double>":
            setattr(message, name, [0.5, 1.5])
        elif kind.startswith("sequence<diagnostic_msgs/DiagnosticStatus"):
            message.status = [
                DiagnosticStatus(name=NAME, values=[KeyValue(key="case 1", value="1")])
            ]
        elif kind.startswith("sequence<sensor_msgs/PointField"):
            message.fields = [PointField(name="x", offset=0, datatype=7, count=1)]
    if isinstance(message, WrenchStamped):
        message.wrench.force.x = 1.0
    return message


def known_layout(data: bytes) -> Any:
    """Read joint states like a subscriber that has learnt the layout of its driver."""
    read = JointStateReader(MachineAxes())
    read(serialised(example(topics.JOINT_STATES)))
    return read(data)


BYTE_DECODERS: dict[Topic, tuple[Callable[[bytes], Any], ...]] = {
    topics.JOINT_STATES: (JointStateReader(MachineAxes()), known_layout),
    topics.TENSION: (decode_tension,),
    topics.IMAGE: (decode_image,),
    topics.TRACKED_MARKERS: (lambda data: decode_cloud(data, MARKER_DTYPE),),
}


@pytest.mark.parametrize("topic", topics.TOPICS, ids=lambda topic: topic.name)
@fuzzed
@given(
    changes=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=6),
    length=st.one_of(st.just(1.0), st.floats(0, 1)),
    garbage=st.one_of(st.none(), st.binary(max_size=120)),
)
def test_changed_bytes_of_a_message(
    topic: Topic, changes: list[tuple[float, int]], length: float, garbage: bytes | None
) -> None:
    whole = serialize_message(example(topic)) if garbage is None else garbage
    content = bytearray(whole[: round(length * len(whole))])
    for place, value in changes if content else []:
        content[int(place * len(content))] = value
    data = bytes(content)
    taken(lambda data: topic.decode(deserialised(data, topic.type)), data)
    for decode in BYTE_DECODERS.get(topic, ()):
        taken(decode, data)
