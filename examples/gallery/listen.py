"""A ROS 2 node of your own, beside `winding run`: print the corrected lengths as they arrive."""

import contextlib

import rclpy.executors
from sensor_msgs.msg import PointCloud2

import cable_winding as cw


def show(cloud: PointCloud2) -> None:
    t = cloud.header.stamp.sec + 1e-9 * cloud.header.stamp.nanosec
    rows = cw.Markers.from_message(cloud)
    lengths = (f"P{n} {1e3 * s:.1f} mm" for n, s in zip(rows.id, rows.s, strict=True))
    print(f"{t:.2f} s:", *lengths, flush=True)


rclpy.init()
node = rclpy.create_node("listener", namespace="winding")
node.create_subscription(PointCloud2, "correction/markers", show, 10)
with contextlib.suppress(KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    rclpy.spin(node)
