"""The orchestrator's own node, spun in a thread, with service calls that asyncio can await."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from winding_core.status import Level, Status
from winding_ros import topics
from winding_ros.diagnostic_messages import decode_diagnostics, encode_diagnostics
from winding_ros.environment import enclave_arguments, ros_arguments
from winding_ros.heartbeat import Heartbeat, Sign, heartbeat_topic, watch_heartbeat
from winding_ros.service_calls import ServiceCaller
from winding_ros.topic_status import subscribers_of

_SPIN_PERIOD = 0.1
NAME = topics.ORCHESTRATOR


class AsyncClient(ServiceCaller):
    """Node `orchestrator`: calls services, remembers what every node says of itself."""

    def __init__(self, namespace: str) -> None:
        self._context = Context()
        rclpy.init(
            # What it says comes out on stderr; a file of rcl's has no bound.
            args=[
                NAME,
                *enclave_arguments(namespace, NAME),
                "--ros-args",
                "--disable-external-lib-logs",
            ],
            context=self._context,
            signal_handler_options=rclpy.SignalHandlerOptions.NO,
        )
        node = Node(NAME, context=self._context, cli_args=ros_arguments(namespace))
        self._executor = EventsExecutor(context=self._context)
        super().__init__(node, self._executor.wake)
        self._hardware_id = f"/{namespace}"
        self._statuses: dict[str, Status] = {}
        topics.DIAGNOSTICS.subscribe(self.node, self._note)
        self._diagnostics = topics.DIAGNOSTICS.advertise(self.node)
        self._heartbeat = Heartbeat(self.node, NAME)
        self._executor.add_node(self.node)
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._spin, name="orchestrator")

    def start(self) -> None:
        """Begin to spin."""
        self._thread.start()

    def close(self) -> None:
        """Stop spinning and leave the graph."""
        self._quit.set()
        if self._thread.is_alive():
            self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def status(self, name: str) -> Status | None:
        """Return the last status of that name, such as `winding_rig` or `winding_rig: topics`."""
        return self._statuses.get(name)

    def beat(self) -> None:
        """Say that the orchestrator lives; nodes that move something stop when it falls silent."""
        self._heartbeat.beat()

    def watch(self, name: str, told: Callable[[Sign], None]) -> None:
        """Tell of a node's signs of life, and of their end, in the event loop that runs now."""
        loop = asyncio.get_running_loop()

        def hand_over(sign: Sign) -> None:
            # The last signs of life may come when nobody listens any more.
            if not loop.is_closed():
                loop.call_soon_threadsafe(told, sign)

        watch_heartbeat(self.node, name, hand_over)
        self._executor.wake()

    def present(self, name: str) -> int:
        """Return how many processes of a node the graph knows, those lately killed included."""
        return int(self.node.count_publishers(heartbeat_topic(name)))

    def tell(self, t: float, level: Level, name: str, message: str, values: dict[str, str]) -> None:
        """Publish a status of the orchestrator's own, at simulated time t [s]."""
        status = Status(name=f"{NAME}: {name}", level=level, message=message, values=values)
        self._diagnostics.publish(encode_diagnostics(t, [status], hardware_id=self._hardware_id))

    def matched(self, node: str, topic: str) -> int:
        """Return how many subscriptions a node's publisher says it has."""
        status = self._statuses.get(f"{node}: topics")
        return subscribers_of(status.values).get(topic, 0) if status else 0

    def _note(self, message: Any) -> None:
        if any(status.hardware_id == self._hardware_id for status in message.status):
            _, statuses = decode_diagnostics(message)
            self._statuses |= {status.name: status for status in statuses}

    def _spin(self) -> None:
        while not self._quit.is_set():
            self._executor.spin_once(timeout_sec=_SPIN_PERIOD)
