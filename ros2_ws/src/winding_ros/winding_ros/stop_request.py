"""Any node may ask the machine to stop, without the orchestrator and without /diagnostics."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node

from winding_ros.services import QUICK_STOP

# An answer can be lost; a machine that stands already stays where it is [s].
_REPEAT = 0.5


class StopRequest:
    """Calls rig/quick_stop, at most every half second.

    Args:
        node: Who asks.
        clock: Monotonic wall time [s].
    """

    def __init__(self, node: Node, clock: Callable[[], float] = time.monotonic) -> None:
        self._node = node
        self._clock = clock
        self._next = -1.0
        self._client = QUICK_STOP.client(node)

    def ask(self, reason: str) -> None:
        """Ask the machine to come to rest, and say why."""
        now = self._clock()
        if now < self._next or not self._client.service_is_ready():
            return
        self._next = now + _REPEAT
        self._node.get_logger().error(f"asked the machine to stop: {reason}")
        self._client.call_async(QUICK_STOP.type.Request())
