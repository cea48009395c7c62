"""Messages as bytes: what other readers and writers of CDR make of them, and equal for equal."""

import struct
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Imu, JointState, PointCloud2, Temperature
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker

from winding_core.machine.axes import MachineAxes
from winding_core.machine.readings import AxisReading, Quantity
from winding_ros.messages.cdr import CdrError, CdrReader, serialised
from winding_ros.messages.clouds import decode_cloud, encode_cloud
from winding_ros.messages.rig import (
    JointStateLayout,
    JointStateReader,
    decode_tension,
    encode_joint_state,
    encode_quantity,
)
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import serialised_stamp

JOINTS = ("cylinder_joint", "carriage_joint")
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
    JointTrajectory(joint_names=["x"], points=[JointTrajectoryPoint(positions=[1.0])]),
    Imu(),
]


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
        name=["brake", *JOINTS], position=[9.0, 1.5, 0.25], velocity=[0.0, 2.0, -1.0]
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
    layout = JointStateLayout.of(joint_state(0), JOINTS)
    assert layout.fits(joint_state(0xA5))
    assert layout.numbers(joint_state(0xA5)) == (0.0, 1.5, 0.25, 2.0, -1.0)


def test_a_driver_that_changes_its_joints_is_read_on() -> None:
    read = JointStateReader(MachineAxes())
    first = AxisReading(
        cylinder_angle=1.5, angular_speed=2.0, carriage_position=0.25, feed_speed=-1.0
    )
    assert read(joint_state(0))[1] == first
    assert read(joint_state(1))[1] == first
    turned = JointState(name=[*reversed(JOINTS)], position=[0.5, 3.0], velocity=[0.1, 0.2])
    assert read(serialised(turned))[1].cylinder_angle == 3.0


def test_a_number_that_is_not_finite_is_refused_at_its_known_place() -> None:
    read = JointStateReader(MachineAxes())
    reading = AxisReading(
        cylinder_angle=0.0, angular_speed=0.0, carriage_position=0.0, feed_speed=0.0
    )
    read(encode_joint_state(0.0, reading))
    data = bytearray(encode_joint_state(0.0, reading))
    layout = JointStateLayout.of(bytes(data), JOINTS)
    data[layout.positions[0] : layout.positions[0] + 8] = np.float64(np.nan).tobytes()
    with pytest.raises(MessageError, match="must be finite"):
        read(bytes(data))


def test_a_message_of_another_byte_order_is_left_to_the_middleware() -> None:
    with pytest.raises(CdrError, match="little-endian"):
        CdrReader(b"\x00\x00\x00\x00" + bytes(8))


def test_a_sensor_of_any_message_type_is_written() -> None:
    heat = Quantity(name="heat", unit="K", sensor="thermometer", field="temperature")
    message = deserialize_message(encode_quantity(Temperature, heat, 2.5, 293.15), Temperature)
    assert (message.temperature, message.variance) == (293.15, 0.0)
    assert message.header.frame_id == "thermometer"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (2, 500_000_000)


def test_a_cloud_says_whether_all_its_points_are_there() -> None:
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
