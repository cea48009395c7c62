"""What the cells of these tests have in common: sensors, services, and a process of their own."""

import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_srvs.srv import Trigger

from winding_core.cable.condition import Condition


class SensorCell(Node):
    """Publishes what its sensors measure; every thread keeps its own absolute schedule.

    A cell defines start, stop and reset, and may define emergency_stop; each returns whether it
    was done.

    Args:
        case: Row of the paper's Table 1.
        camera: Whether it has one.
    """

    def __init__(self, case: int, *, camera: bool) -> None:
        super().__init__("cell")
        self.what = Condition(case=case, duration=20.0).resolved()
        self.joints = self.create_publisher(JointState, "rig/joint_states", 100)
        self.force = self.create_publisher(WrenchStamped, "rig/tension", 100)
        if camera:
            self.images = self.create_publisher(Image, "camera/image_raw", 50)
            self.compressed_images = self.create_publisher(
                CompressedImage, "camera/image_raw/compressed", 50
            )
            self.infos = self.create_publisher(CameraInfo, "camera/camera_info", 50)
        services = {
            "start": self.start,
            "stop": self.stop,
            "quick_stop": self.stop,
            "emergency_stop": self.emergency_stop,
            "reset": self.reset,
        }
        for name, act in services.items():
            self.create_service(Trigger, f"rig/{name}", partial(self.answer, act))
        self.quit = threading.Event()
        self.threads: list[threading.Thread] = []

    def answer(self, act: Callable[[], bool], _: Any, response: Any) -> Any:
        response.success = act()
        return response

    def emergency_stop(self) -> bool:
        return self.stop()

    def begin(self, *works: Callable[[], None]) -> None:
        """Run works in a thread each; the cell is ready."""
        self.threads = [threading.Thread(target=work) for work in works]
        for thread in self.threads:
            thread.start()
        self.get_logger().info("ready")

    def instants(self, period: float) -> Iterator[float]:
        """Yield wall times [s] a period apart, each when it has come, until the cell ends."""
        due = time.time()
        while not self.quit.is_set():
            due += period
            time.sleep(max(0.0, due - time.time()))
            yield due

    def publish_force(self, joints: JointState) -> None:
        """Publish the dead weight under the stamp of a joint state."""
        force = WrenchStamped(header=joints.header)
        force.wrench.force.x = self.what.case.weight
        self.force.publish(force)

    def later(self, outbox: "queue.SimpleQueue[tuple[float, JointState]]") -> None:
        """Publish joint states when they are due, in order."""
        while not self.quit.is_set():
            try:
                due, message = outbox.get(timeout=0.1)
            except queue.Empty:
                continue
            time.sleep(max(0.0, due - time.time()))
            self.joints.publish(message)


def run_cell(new_cell: Callable[[], SensorCell]) -> SensorCell:
    """Spin a cell until SIGTERM; return it when its threads have ended."""
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    cell = new_cell()
    signal.signal(signal.SIGTERM, lambda *_: cell.quit.set())
    while not cell.quit.is_set():
        rclpy.spin_once(cell, timeout_sec=0.02)
    for thread in cell.threads:
        thread.join()
    rclpy.try_shutdown()
    return cell
