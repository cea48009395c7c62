"""What codecs refuse, and their bytes for other readers; round trips are in `tests/fuzz`."""

import math
import struct
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from axis_readings import axis_reading
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import (
    CameraInfo,
    CompressedImage,
    Image,
    Imu,
    JointState,
    PointCloud2,
    Temperature,
)
from trajectory_msgs.msg import JointTrajectory as TrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint
from visualization_msgs.msg import Marker

from marker_tracker_node.camera.image_formats import PixelReader
from winding_core.cable.material_report import MaterialReport, refused_material
from winding_core.machine.axes import JointSample, MachineAxes
from winding_core.machine.commands import AxisTarget, JointTargets, JointTrajectory, Waypoint
from winding_core.machine.readings import AxisReading, GuidePlace, Quantity
from winding_core.markers import CORRECTED_DTYPE, MARKER_DTYPE, MarkerFlag, wound_markers
from winding_core.status import Level, Status
from winding_ros.messages.camera import decode_camera_info, decode_image, encode_image
from winding_ros.messages.cdr import CdrError, CdrReader, serialised
from winding_ros.messages.clouds import (
    decode_cloud,
    decode_line_width,
    encode_cloud,
    encode_line_strip,
)
from winding_ros.messages.commands import decode_targets, decode_trajectory, encode_targets
from winding_ros.messages.diagnostics import (
    NAME,
    decode_case_votes,
    decode_material,
    encode_case_votes,
    encode_diagnostics,
    encode_material,
)
from winding_ros.messages.rig import (
    JointStateLayout,
    JointStateReader,
    decode_joint_state,
    decode_tension,
    encode_joint_state,
    encode_quantity,
    encode_tension,
)
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import serialised_stamp

JOINTS = ["carriage_joint", "cylinder_joint"]
READING = axis_reading(12.25, 0.035, speed=1.74, feed=0.005)
AXIS_JOINTS = ("cylinder_joint", "carriage_joint")
MESSAGES = [
    JointState(name=["a", "bc", ""], position=[1.0, -2.5], effort=[float("inf")]),
    CameraInfo(k=np.arange(9.0), d=[0.5], distortion_model="plumb_bob", binning_x=3),
    CompressedImage(format="jpeg", data=bytes(range(7))),
    Marker(ns="cable", id=-4, points=[Point(x=float(k), y=0.5, z=-1.0) for k in range(5)]),
    DiagnosticArray(
        status=[
            DiagnosticStatus(level=DiagnosticStatus.WARN, name="n", values=[KeyValue(key="k")]),
            DiagnosticStatus(message="später"),
        ]
    ),
    TrajectoryMessage(joint_names=["x"], points=[JointTrajectoryPoint(positions=[1.0])]),
    Imu(),
]


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
        (decode_camera_info,
         CameraInfo(k=[1.0] * 9, d=[0.0] * 8, distortion_model="plumb_bob"),
         "plumb_bob has 5 coefficients, got 8"),
        *((decode_case_votes, encode_case_votes(0.0, {1: share}), "share of votes lies in 0 to 1")
          for share in (math.nan, math.inf, -0.1, 1.5)),
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
def test_what_a_topic_does_not_promise_is_refused(decode: Any, message: Any, sentence: str) -> None:
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
        ids=[0, 1, 2],
        theta=[0.0, 6.28, 12.52],
        z=[0.0, 0.0045, 0.01486],
        radius=0.017,
        cylinder_angle=13.0,
        flags=[0, 0, MarkerFlag.TOUCHING],
    )
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
        law="linear",
        young=3.1234567890123e6,
        standard_error=2.0e4,
        half_width_90=3.3e4,
        markers=(1, 2),
        worst_share=1.0e-4,
        taken_up=True,
    )
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
def test_trajectories_are_read(speed: float | None) -> None:
    message = trajectory(["carriage_joint"], (2, [0.1], [] if speed is None else [speed]))
    message.header.stamp.sec = 1
    waypoint = Waypoint(t=2.0, position=0.1, speed=speed)
    plan = JointTrajectory(t=1.0, axes={"carriage": (waypoint,)})
    assert decode_trajectory(message) == (1.0, plan)


def test_an_empty_trajectory_holds_both_axes() -> None:
    assert decode_trajectory(TrajectoryMessage())[1].axes == {"cylinder": (), "carriage": ()}


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_the_middleware_reads_what_is_written(message: Any) -> None:
    # Through the middleware once, for numbers of single precision.
    wanted = deserialize_message(serialize_message(message), type(message))
    assert str(deserialize_message(serialised(message), type(message))) == str(wanted)


def test_equal_messages_are_equal_bytes() -> None:
    def dirty() -> bytes:
        # Memory that other messages have used.
        serialize_message(CompressedImage(data=np.random.default_rng(1).bytes(4096)))
        return serialised(JointState(name=["abc"], position=[1.0]))

    assert len({dirty() for _ in range(20)}) == 1


def joint_state(padding: int) -> bytes:
    """Return a driver's message whose bytes between the fields are of some value."""
    message = JointState(
        name=["brake", *AXIS_JOINTS], position=[9.0, 1.5, 0.25], velocity=[0.0, 2.0, -1.0]
    )
    other = bytearray(serialised(message))
    reader = CdrReader(bytes(other))
    reader.skip(4, 2)
    reader.string()
    reader.u32()
    for _ in message.name:
        end = reader.offset
        begin = reader.skip(4, 0)
        other[end:begin] = bytes([padding]) * (begin - end)
        reader.string()
    return bytes(other)


def test_numbers_are_found_whatever_stands_between_the_fields() -> None:
    layout = JointStateLayout.of(joint_state(0), AXIS_JOINTS)
    assert layout.fits(joint_state(0xA5))
    assert layout.sample(joint_state(0xA5)) == JointSample(
        t=0.0, cylinder=1.5, carriage=0.25, cylinder_speed=2.0, carriage_speed=-1.0
    )


def test_a_driver_that_changes_its_joints_is_read_on() -> None:
    read = JointStateReader(MachineAxes())
    first = axis_reading(1.5, 0.25, speed=2.0, feed=-1.0)
    assert read(joint_state(0))[1] == first
    assert read(joint_state(1))[1] == first
    turned = JointState(name=[*reversed(AXIS_JOINTS)], position=[0.5, 3.0], velocity=[0.1, 0.2])
    assert read(serialised(turned))[1].cylinder_angle == 3.0


def test_a_number_that_is_not_finite_is_refused_at_its_known_place() -> None:
    read = JointStateReader(MachineAxes())
    reading = axis_reading()
    read(encode_joint_state(0.0, reading))
    data = bytearray(encode_joint_state(0.0, reading))
    layout = JointStateLayout.of(bytes(data), AXIS_JOINTS)
    data[layout.positions[0] : layout.positions[0] + 8] = np.float64(np.nan).tobytes()
    with pytest.raises(MessageError, match="must be finite"):
        read(bytes(data))


def test_a_guide_that_moves_across_the_axis_is_read_with_the_axes() -> None:
    guide = GuidePlace(x=0.02, y=-0.19)
    reading = AxisReading(
        cylinder_angle=1.0, angular_speed=2.0, carriage_position=0.3, feed_speed=0.1, guide=guide
    )
    data = encode_joint_state(0.0, reading)
    read = JointStateReader(MachineAxes())
    # The first is taken apart as a message, the second by its bytes.
    assert [read(data)[1] for _ in range(2)] == [reading, reading]
    names = [*AXIS_JOINTS, "guide_y_joint", "guide_x_joint"]
    turned = JointState(name=names, position=[1.0, 0.3, guide.y, guide.x])
    assert read(turned)[1].guide == guide
    turned.position[2] = float("inf")
    with pytest.raises(MessageError, match=r"the guide's place must be finite, got \(0.02, inf\)"):
        read(turned)


def test_a_message_of_another_byte_order_is_left_to_the_middleware() -> None:
    with pytest.raises(CdrError, match="little-endian"):
        CdrReader(b"\x00\x00\x00\x00" + bytes(8))


def test_a_sensor_of_any_message_type_is_written() -> None:
    heat = Quantity(name="heat", unit="K", sensor="thermometer", field="temperature")
    message = deserialize_message(encode_quantity(Temperature, heat, 2.5, 293.15), Temperature)
    assert (message.temperature, message.variance) == (293.15, 0.0)
    assert message.header.frame_id == "thermometer"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (2, 500_000_000)


def test_a_cloud_is_dense_only_with_all_its_points() -> None:
    records = np.zeros(2, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("id", "<i4")])
    assert deserialize_message(encode_cloud(0.0, records), PointCloud2).is_dense
    records["z"][1] = np.nan
    message = deserialize_message(encode_cloud(0.0, records), PointCloud2)
    assert not message.is_dense
    assert (message.width, message.row_step) == (2, 32)


def test_threads_that_encode_at_once_do_not_mix_their_messages() -> None:
    dtype = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8")])

    def encode(count: int) -> set[tuple[float, int]]:
        clouds = [encode_cloud(float(count), np.zeros(count, dtype=dtype)) for _ in range(2000)]
        return {(serialised_stamp(data), len(decode_cloud(data, dtype)[1])) for data in clouds}

    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(encode, range(1, 5)))
    assert found == [{(float(count), count)} for count in range(1, 5)]


def test_a_load_cell_of_the_other_byte_order_is_read() -> None:
    # Stamp, an empty frame with the zero at its end, force and torque.
    data = bytes(4) + struct.pack(">iII4x6d", 3, 0, 1, 1.96, *[0.0] * 5)
    assert decode_tension(data) == (3.0, 1.96)
