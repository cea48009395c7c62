"""What codecs refuse, and what a round trip does not show; those are in `tests/fuzz`."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from trajectory_msgs.msg import JointTrajectory as TrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint
from visualization_msgs.msg import Marker

from marker_tracker_node.camera.image_formats import PixelReader
from winding_core.cable.material_report import MaterialReport, refused_material
from winding_core.machine.commands import AxisTarget, JointTargets, JointTrajectory, Waypoint
from winding_core.machine.readings import AxisReading
from winding_core.markers import CORRECTED_DTYPE, MARKER_DTYPE, MarkerFlag, wound_markers
from winding_core.status import Level, Status
from winding_ros.messages.camera import decode_camera_info, decode_image, encode_image
from winding_ros.messages.cdr import serialised
from winding_ros.messages.clouds import (
    decode_cloud,
    decode_line_width,
    encode_cloud,
    encode_line_strip,
)
from winding_ros.messages.commands import (
    decode_targets,
    decode_trajectory,
    encode_targets,
    encode_trajectory,
)
from winding_ros.messages.diagnostics import (
    NAME,
    decode_case_votes,
    decode_material,
    encode_case_votes,
    encode_diagnostics,
    encode_material,
)
from winding_ros.messages.rig import (
    decode_joint_state,
    decode_tension,
    encode_joint_state,
    encode_tension,
)
from winding_ros.messages.serialised import MessageError

JOINTS = ["carriage_joint", "cylinder_joint"]
READING = AxisReading(
    cylinder_angle=12.25, angular_speed=1.74, carriage_position=0.035, feed_speed=0.005
)


def through_the_wire(data: bytes, type_: type) -> Any:
    return deserialize_message(data, type_)


def image(**changes: object) -> Any:
    message = through_the_wire(encode_image(0.0, np.zeros((2, 2, 3), dtype=np.uint8)), Image)
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def material(**values: str) -> DiagnosticArray:
    return encode_diagnostics(0.0, [Status(name=NAME, values=values)])


def trajectory(names: list[str], *points: tuple[int, list[float], list[float]]) -> Any:
    """Return a message of points (seconds, positions, velocities)."""
    return TrajectoryMessage(
        joint_names=names,
        points=[
            JointTrajectoryPoint(
                positions=positions, velocities=velocities, time_from_start=Duration(sec=seconds)
            )
            for seconds, positions, velocities in points
        ],
    )


def decode_corrected(message: Any) -> Any:
    return decode_cloud(message, CORRECTED_DTYPE)


@pytest.mark.parametrize(
    ("decode", "message", "sentence"),
    [
        (decode_joint_state, JointState(name=["elbow"], position=[1.0], velocity=[0.0]),
         "needs position of cylinder_joint"),
        (decode_joint_state, JointState(name=JOINTS, position=[0.0, math.nan], velocity=[0.0] * 2),
         "must be finite"),
        (decode_tension, encode_tension(2.0, math.inf), "tension must be finite, got inf N"),
        (decode_image, image(encoding="mono8"), "encoding 'mono8' holds no colour"),
        (decode_image, image(encoding="yuv422"), "must be one of bgr8, rgb8, .*, got 'yuv422'"),
        (decode_image, image(height=3), "needs 18 bytes, got 12"),
        (decode_camera_info, CameraInfo(), r"not calibrated: camera_info has K\[0\] = 0"),
        (decode_corrected, encode_cloud(0.0, np.zeros(1, dtype=MARKER_DTYPE)),
         "needs a field s_fem of type float64"),
        (decode_line_width,
         through_the_wire(encode_line_strip(1.0, np.zeros((2, 3)), 0.0), Marker),
         r"positive and finite, got 0\.0 m"),
        (decode_material, DiagnosticArray(), "one status named"),
        (decode_material, encode_diagnostics(0.0, [Status(name="other")]), "one status named"),
        (decode_material, material(law="linear"), "needs the value"),
        (decode_material, material(law="x", young="soft"),
         "young of a material must be a number, got 'soft'"),
        (decode_targets, JointState(name=["guide"], position=[0.0]),
         "joints must be .* got .*guide"),
        (decode_targets, JointState(name=JOINTS[:1] * 2, position=[0.0] * 2), "each once at most"),
        (decode_targets, JointState(name=JOINTS, position=[0.0]),
         "one for each of 2 joints, got 1"),
        (decode_targets, JointState(name=JOINTS[:1], velocity=[math.inf]),
         "finite or NaN, got velocity"),
        (decode_targets, JointState(name=JOINTS[:1], effort=[1.0]),
         "positions or velocities, got an effort"),
        (decode_targets, JointState(name=JOINTS), "a position or a velocity, got none"),
        (decode_trajectory, trajectory([], (1, [0.0], [])), "needs joint_names, got none"),
        (decode_trajectory, trajectory(JOINTS, (1, [0.0], [])),
         "needs 2 positions in each point"),
        (decode_trajectory, trajectory(JOINTS[:1], (2, [0.0], []), (1, [0.1], [])),
         "must ascend .* point 1 has 1 s after 2 s"),
        (decode_trajectory, trajectory(JOINTS[:1], (1, [0.0], [0.0]), (2, [0.1], [])),
         "velocities in each or none, point 1 has 1 and 0"),
        (decode_trajectory, trajectory(JOINTS[:1], (1, [math.nan], [])),
         "must be finite, point 0 is not"),
    ],
)  # fmt: skip
def test_what_a_topic_does_not_promise_is_refused(
    decode: Callable[[Any], Any], message: Any, sentence: str
) -> None:
    with pytest.raises(MessageError, match=sentence):
        decode(message)
    if isinstance(message, Image):
        with pytest.raises(MessageError, match=sentence):
            decode(serialize_message(message))


def test_joint_order_does_not_matter() -> None:
    message = through_the_wire(encode_joint_state(1.5, READING), JointState)
    for name in ("name", "position", "velocity"):
        setattr(message, name, list(reversed(getattr(message, name))))
    assert decode_joint_state(message) == (1.5, READING)


def test_rgb_image_is_turned_to_bgr() -> None:
    frame = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    message = through_the_wire(encode_image(0.0, frame), Image)
    message.encoding = "rgb8"
    for received in (message, serialize_message(message)):
        np.testing.assert_array_equal(decode_image(received, PixelReader())[1], frame[:, :, ::-1])


def test_clouds_of_any_publisher_are_read() -> None:
    records = wound_markers(
        ids=[0, 1, 2], theta=[0.0, 6.28, 12.52], z=[0.0, 0.0045, 0.01486], radius=0.017,
        cylinder_angle=13.0, flags=[0, 0, MarkerFlag.TOUCHING],
    )  # fmt: skip
    for wanted in (records, records[:0]):
        data = encode_cloud(4.25, wanted)
        # Of equal content, the bytes of another publisher differ.
        message = through_the_wire(data, PointCloud2)
        for received in (data, message, serialize_message(message)):
            t, decoded = decode_cloud(received, MARKER_DTYPE)
            assert t == 4.25
            np.testing.assert_array_equal(decoded, wanted)


def test_corrected_cloud_reads_as_plain_markers() -> None:
    records = np.zeros(2, dtype=CORRECTED_DTYPE)
    records["theta"], records["h"] = [1.0, 2.0], 0.97
    _, decoded = decode_cloud(encode_cloud(0.0, records), MARKER_DTYPE)
    np.testing.assert_array_equal(decoded["theta"], [1.0, 2.0])


@pytest.mark.parametrize("count", [1, 2, 3, 148])
def test_line_of_any_length_is_that_of_the_middleware(count: int) -> None:
    points = np.random.default_rng(5).normal(size=(count, 3))
    data = encode_line_strip(12.5, points, 0.0025)
    message = through_the_wire(data, Marker)
    assert decode_line_width(message) == (12.5, 0.0025)
    assert [[p.x, p.y, p.z] for p in message.points] == points.tolist()
    assert serialised(message) == data


def test_a_line_needs_points() -> None:
    with pytest.raises(ValueError, match="needs points, got none"):
        encode_line_strip(0.0, np.zeros((0, 3)), 0.004)


def test_no_votes_mean_that_nothing_is_measured() -> None:
    message = encode_case_votes(0.0, {})
    assert message.status[0].message == "no marker is measured yet"
    assert decode_case_votes(message)[1] == {}


def test_material_is_reported_in_words_and_none_before_it_is_identified() -> None:
    found = MaterialReport(
        law="linear", young=3.1234567890123e6, standard_error=2.0e4, half_width_90=3.3e4,
        markers=(1, 2), worst_share=1.0e-4, taken_up=True,
    )  # fmt: skip
    status = encode_material(0.0, found).status[0]
    assert status.message == (
        "effective modulus 3.123 MPa, nine times in ten within 0.033 MPa, from P1, P2"
    )
    assert status.level == bytes([Level.OK])
    assert decode_material(encode_material(0.0, None)) == (0.0, None)


def test_refused_material_is_a_warning_with_its_cause() -> None:
    message = encode_material(1.0, refused_material("linear", (1,), "it is rigid"))
    _, report = decode_material(message)
    assert message.status[0].level == bytes([Level.WARN])
    assert report is not None
    assert report.refusal == "it is rigid"
    assert math.isnan(report.young)


def test_targets_come_back_with_what_is_left_open() -> None:
    targets = JointTargets(
        t=2.5, axes={"carriage": AxisTarget(position=0.1), "cylinder": AxisTarget(speed=-1.0)}
    )
    assert decode_targets(encode_targets(targets)) == (2.5, targets)
    message = JointState(name=JOINTS, position=[math.nan, 0.5], velocity=[])
    assert decode_targets(message)[1].axes == {"cylinder": AxisTarget(position=0.5)}


@pytest.mark.parametrize("speed", [None, 0.25])
def test_trajectories_come_back(speed: float | None) -> None:
    plan = JointTrajectory(t=1.5, axes={"carriage": (Waypoint(t=0.5, position=0.1, speed=speed),)})
    assert decode_trajectory(encode_trajectory(plan)) == (1.5, plan)


def test_an_empty_trajectory_holds_both_axes() -> None:
    assert decode_trajectory(TrajectoryMessage())[1].axes == {"cylinder": (), "carriage": ()}
