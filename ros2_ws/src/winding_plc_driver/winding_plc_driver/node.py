"""ROS side of the driver: the topics and services of a machine, and nothing else."""

import asyncio
import threading
import time
from collections.abc import Awaitable, Callable, Collection
from concurrent.futures import CancelledError
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from winding_core.machine.joining import Sample
from winding_core.status import Status
from winding_plc_driver.machine.mapping import ANGLE, ANGULAR_SPEED, CARRIAGE, COMMANDS, FEED_SPEED
from winding_plc_driver.machine.pacing import Measured
from winding_ros import graph, services, topics
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.messages.rig import BASE_FRAME, CARRIAGE_JOINT, CYLINDER_JOINT, encode_quantity
from winding_ros.messages.stamps import stamp_bytes_of, with_stamp

# Quantities that the graph has a topic for, and their topics.
QUANTITIES = {topic.quantity: topic for topic in graph.RIG.publishes if topic.quantity is not None}
_NANO = 1_000_000_000
_ENDING = "the driver ends"


class PlcDriverNode(Node):  # type: ignore[misc]
    """Plain node `winding_rig`: rig/joint_states, rig/tension, /diagnostics, rig/start and so on.

    Publishes on the thread that calls it. Services are served by threads of their own, so that a
    command that hangs holds no stop back.

    Args:
        context: Of ROS, initialised.
        command: Returns (whether it was done, one sentence) for a command's name.
        loop: Event loop that commands run on.
        endpoint: Address of the PLC, for /diagnostics.
        measured: Names of the quantities that the machine has.
    """

    def __init__(
        self,
        context: Context,
        command: Callable[[str], Awaitable[tuple[bool, str]]],
        loop: asyncio.AbstractEventLoop,
        endpoint: str,
        measured: Collection[str],
    ) -> None:
        super().__init__(topics.RIG, context=context)
        self._command, self._loop, self._endpoint = command, loop, endpoint
        self._joint_states = topics.JOINT_STATES.advertise(self)
        self._measured = {
            quantity.name: (quantity, topic.type, topic.advertise(self))
            for quantity, topic in QUANTITIES.items()
            if quantity.name in measured
        }
        self._diagnostics = topics.DIAGNOSTICS.advertise(self)
        group = ReentrantCallbackGroup()
        served = (
            services.START,
            services.STOP,
            services.QUICK_STOP,
            services.RESET,
            services.EMERGENCY_STOP,
        )
        for name, service in zip(COMMANDS, served, strict=True):
            self.create_service(service.type, service.name, self._serve(name), callback_group=group)
        self._executor = MultiThreadedExecutor(2 * len(COMMANDS), context=context)
        self._executor.add_node(self)
        self._thread = threading.Thread(target=self._spin, name="services")
        self._thread.start()

    def joints(self, sample: Sample) -> None:
        """Publish the axes, with velocities where the PLC has both."""
        values = sample.values
        message = JointState(
            name=[CYLINDER_JOINT, CARRIAGE_JOINT], position=[values[ANGLE], values[CARRIAGE]]
        )
        if ANGULAR_SPEED in values and FEED_SPEED in values:
            message.velocity = [values[ANGULAR_SPEED], values[FEED_SPEED]]
        message.header.frame_id = BASE_FRAME
        message.header.stamp = _stamp(sample.stamp_ns)
        self._joint_states.publish(message)

    def measured(self, stamp_ns: int, measured: Measured) -> None:
        """Publish the value of a quantity with its source timestamp [ns]."""
        quantity, message_type, publisher = self._measured[measured.name]
        message = encode_quantity(message_type, quantity, 0.0, measured.value)
        publisher.publish(with_stamp(message, stamp_bytes_of(stamp_ns)))

    def status(self, status: Status) -> None:
        """Publish the driver's state."""
        self._diagnostics.publish(encode_diagnostics(time.time(), [status], self._endpoint))

    def log(self, text: str) -> None:
        """Report an event to the operator."""
        self.get_logger().info(text)

    def close(self) -> None:
        """Stop serving and leave the graph; the event loop has ended."""
        self._executor.shutdown()
        self._thread.join()
        self.destroy_node()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return

    def _serve(self, name: str) -> Callable[[Any, Any], Any]:
        def answer(_: Any, response: Any) -> Any:
            response.success, response.message = self._ask(name)
            return response

        return answer

    def _ask(self, name: str) -> tuple[bool, str]:
        work = self._command(name)
        try:
            return asyncio.run_coroutine_threadsafe(work, self._loop).result()  # type: ignore[arg-type]
        except (CancelledError, RuntimeError):
            # The loop has ended, or ends.
            return False, _ENDING


def _stamp(ns: int) -> Time:
    seconds, rest = divmod(ns, _NANO)
    return Time(sec=seconds, nanosec=rest)
