"""Any node may ask the machine to stop, without the orchestrator and without /diagnostics."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node

from winding_ros.services import QUICK_STOP, STOP

# An answer can be lost; a machine that stands already stays where it is [s].
_REPEAT = 0.5


class StopRequest:
    """Calls rig/quick_stop, or rig/stop where nobody serves that, at most every half second.

    Args:
        node: Who asks.
        clock: Monotonic wall time [s].
    """

    def __init__(self, node: Node, clock: Callable[[], float] = time.monotonic) -> None:
        self._node = node
        self._clock = clock
        self._next = -1.0
        self._ways = tuple((service, service.client(node)) for service in (QUICK_STOP, STOP))

    def ask(self, reason: str) -> None:
        """Ask the machine to come to rest, and say why."""
        now = self._clock()
        if now < self._next:
            return
        self._next = now + _REPEAT
        for service, client in self._ways:
            if client.service_is_ready():
                self._node.get_logger().error(f"asked the machine to stop: {reason}")
                client.call_async(service.type.Request())
                return
        self._node.get_logger().error(
            f"the machine cannot be asked to stop: nobody serves {QUICK_STOP.name} or "
            f"{STOP.name}: {reason}"
        )
