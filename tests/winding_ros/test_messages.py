"""Every encode has its decode, and refuses what its topic does not promise."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from visualization_msgs.msg import Marker

from marker_tracker_node.camera.image_formats import PixelReader
from winding_core.machine.readings import AxisReading, ImageWindow
from winding_core.markers import CORRECTED_DTYPE, MARKER_DTYPE, MarkerFlag, wound_markers
from winding_core.status import Level, Status
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
    decode_case_votes,
    decode_diagnostics,
    encode_case_votes,
    encode_diagnostics,
)
from winding_ros.messages.rig import (
    decode_joint_state,
    decode_tension,
    encode_joint_state,
    encode_tension,
)
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import decode_stamp, encode_stamp, serialised_stamp_ns

READING = AxisReading(
    cylinder_angle=12.25, angular_speed=1.74, carriage_position=0.035, feed_speed=0.005
)


def through_the_wire(message: Any, type_: type | None = None) -> Any:
    """Return a message, or one of a type in CDR bytes, as a subscriber gets it."""
    if isinstance(message, bytes):
        return deserialize_message(message, type_)
    return deserialize_message(serialize_message(message), type(message))


def test_stamp_round_trip() -> None:
    times = [0.0, 0.001, 19.999, 3600.0, 1.7e9]
    # Doubles carry 1.7e9 s to 0.24 microseconds.
    assert [decode_stamp(encode_stamp(t)) for t in times] == pytest.approx(times, abs=5e-7, rel=0)


def test_stamp_is_read_from_serialised_bytes() -> None:
    assert serialised_stamp_ns(encode_joint_state(3.217, READING)) == 3_217_000_000


def test_bytes_without_a_stamp_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 12 bytes, got 4"):
        serialised_stamp_ns(b"\x00\x01\x00\x00")


def joint_state() -> JointState:
    return through_the_wire(encode_joint_state(1.5, READING), JointState)


def test_joint_state_round_trip() -> None:
    assert decode_joint_state(joint_state()) == (1.5, READING)


def test_joint_order_does_not_matter() -> None:
    message = joint_state()
    for name in ("name", "position", "velocity"):
        setattr(message, name, list(reversed(getattr(message, name))))
    assert decode_joint_state(message)[1] == READING


def test_joint_state_without_the_cylinder_is_refused() -> None:
    with pytest.raises(MessageError, match="needs position of cylinder_joint"):
        decode_joint_state(JointState(name=["elbow"], position=[1.0], velocity=[0.0]))


def test_joint_state_with_nan_is_refused() -> None:
    message = joint_state()
    message.position[0] = float("nan")
    with pytest.raises(MessageError, match="must be finite"):
        decode_joint_state(message)


def test_tension_round_trip_and_refusal() -> None:
    data = encode_tension(2.0, 3.924)
    assert decode_tension(data) == (2.0, 3.924)
    assert decode_tension(through_the_wire(data, WrenchStamped)) == (2.0, 3.924)
    with pytest.raises(MessageError, match="tension must be finite, got inf N"):
        decode_tension(encode_tension(2.0, float("inf")))


def test_image_round_trip() -> None:
    frame = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    data = encode_image(0.25, frame)
    for received in (data, through_the_wire(data, Image)):
        t, decoded = decode_image(received)
        assert t == 0.25
        np.testing.assert_array_equal(decoded, frame)


def test_rgb_image_is_turned_to_bgr() -> None:
    frame = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    message = through_the_wire(encode_image(0.0, frame), Image)
    message.encoding = "rgb8"
    for received in (message, serialize_message(message)):
        np.testing.assert_array_equal(decode_image(received, PixelReader())[1], frame[:, :, ::-1])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"encoding": "mono8"}, "encoding 'mono8' holds no colour"),
        ({"encoding": "yuv422"}, "encoding must be one of bgr8, rgb8, .*, got 'yuv422'"),
        ({"height": 3}, "needs 18 bytes, got 12"),
    ],
)
def test_wrong_image_is_refused(change: dict[str, object], sentence: str) -> None:
    message = through_the_wire(encode_image(0.0, np.zeros((2, 2, 3), dtype=np.uint8)), Image)
    for name, value in change.items():
        setattr(message, name, value)
    for received in (message, serialize_message(message)):
        with pytest.raises(MessageError, match=sentence):
            decode_image(received)


def camera_reading() -> CameraReading:
    return CameraReading(
        width=1920,
        height=1080,
        matrix=np.array([[4900.0, 0.0, 963.2], [0.0, 4900.0, 536.6], [0.0, 0.0, 1.0]]),
        distortion=np.array([-0.12, 0.05, 4e-4, -3e-4, 0.0]),
        window=ImageWindow(x_offset=0, y_offset=393, width=1920, height=288, binning=3),
    )


def test_camera_info_round_trip_keeps_full_resolution_k_and_window() -> None:
    t, decoded = decode_camera_info(through_the_wire(encode_camera_info(0.5, camera_reading())))
    assert t == 0.5
    assert decoded.window == camera_reading().window
    np.testing.assert_array_equal(decoded.matrix, camera_reading().matrix)
    np.testing.assert_array_equal(decoded.distortion, camera_reading().distortion)


def test_uncalibrated_camera_is_refused() -> None:
    with pytest.raises(MessageError, match=r"not calibrated: camera_info has K\[0\] = 0"):
        decode_camera_info(CameraInfo())


def test_preview_round_trip() -> None:
    assert decode_preview(through_the_wire(encode_preview(0.1, b"\xff\xd8jpeg"))) == (
        0.1,
        b"\xff\xd8jpeg",
    )


def test_marker_cloud_round_trip() -> None:
    records = wound_markers(
        ids=[0, 1, 2],
        theta=[0.0, 6.28, 12.52],
        z=[0.0, 0.0045, 0.01486],
        radius=0.017,
        cylinder_angle=13.0,
        flags=[0, 0, MarkerFlag.TOUCHING],
    )
    data = encode_cloud(4.25, records)
    # Of equal content, the bytes of another publisher differ.
    message = through_the_wire(data, PointCloud2)
    for received in (data, message, serialize_message(message)):
        t, decoded = decode_cloud(received, MARKER_DTYPE)
        assert t == 4.25
        np.testing.assert_array_equal(decoded, records)


def test_empty_cloud_round_trip() -> None:
    empty = np.zeros(0, dtype=MARKER_DTYPE)
    assert len(decode_cloud(encode_cloud(0.0, empty), MARKER_DTYPE)[1]) == 0


def test_corrected_cloud_reads_as_plain_markers() -> None:
    records = np.zeros(2, dtype=CORRECTED_DTYPE)
    records["theta"], records["h"] = [1.0, 2.0], 0.97
    _, decoded = decode_cloud(encode_cloud(0.0, records), MARKER_DTYPE)
    np.testing.assert_array_equal(decoded["theta"], [1.0, 2.0])


def test_cloud_without_a_field_is_refused() -> None:
    plain: PointCloud2 = encode_cloud(0.0, np.zeros(1, dtype=MARKER_DTYPE))
    with pytest.raises(MessageError, match="needs a field s_fem of type float64"):
        decode_cloud(plain, CORRECTED_DTYPE)


def test_line_strip_brings_its_points_and_width() -> None:
    points = np.array([[0.017, 0.0, 0.0], [0.0, 0.017, 0.001]])
    message = through_the_wire(encode_line_strip(1.0, points, 0.004), Marker)
    assert decode_line_width(message) == (1.0, 0.004)
    assert [(point.x, point.y, point.z) for point in message.points] == [*map(tuple, points)]


def test_line_of_any_length_is_that_of_the_middleware() -> None:
    rng = np.random.default_rng(5)
    for count in (1, 2, 3, 148):
        points = rng.normal(size=(count, 3))
        data = encode_line_strip(12.5, points, 0.0025)
        message = deserialize_message(data, Marker)
        assert [[p.x, p.y, p.z] for p in message.points] == points.tolist()
        assert serialised(message) == data


def test_a_line_needs_points() -> None:
    with pytest.raises(ValueError, match="needs points, got none"):
        encode_line_strip(0.0, np.zeros((0, 3)), 0.004)


def test_line_without_width_is_refused() -> None:
    with pytest.raises(MessageError, match=r"positive and finite, got 0\.0 m"):
        decode_line_width(through_the_wire(encode_line_strip(1.0, np.zeros((2, 3)), 0.0), Marker))


def test_diagnostics_round_trip() -> None:
    status = Status(name="rig", level=Level.WARN, message="warm", values={"phase": "winding"})
    assert decode_diagnostics(through_the_wire(encode_diagnostics(2.0, [status]))) == (
        2.0,
        (status,),
    )


def test_case_votes_round_trip_best_first() -> None:
    _, votes = decode_case_votes(through_the_wire(encode_case_votes(1.0, {3: 0.2, 4: 0.8})))
    assert list(votes.items()) == [(4, 0.8), (3, 0.2)]


def test_no_votes_say_that_nothing_is_measured() -> None:
    message = encode_case_votes(0.0, {})
    assert message.status[0].message == "no marker is measured yet"
    assert decode_case_votes(message)[1] == {}
