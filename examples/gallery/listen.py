"""A ROS 2 node of your own, beside `winding run`: print the corrected lengths as they come."""

import contextlib

import rclpy
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import PointCloud2

from winding_ros import topics


def show(message: PointCloud2) -> None:
    t, markers = topics.CORRECTED_MARKERS.decode(message)
    lengths = (f"P{m['id']} {1e3 * m['s']:.1f} mm" for m in markers if not m["flags"])
    print(f"{t:.2f} s:", *lengths, flush=True)


rclpy.init()
node = rclpy.create_node("listener", namespace="winding")
topics.CORRECTED_MARKERS.subscribe(node, show)
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(node)
