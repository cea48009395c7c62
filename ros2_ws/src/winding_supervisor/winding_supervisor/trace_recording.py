"""Keeps what the nodes say of the way of each corrected length."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from winding_core.trace import TRACE_DTYPE, usable_records
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.serialised import MessageError


class TraceRecording:
    """Listens to the nodes' traces; they note nothing while nobody does.

    Args:
        node: Spun by somebody else.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._parts: list[NDArray[np.void]] = []
        topics.TRACE.subscribe(node, self._take, raw=True)

    def since(self, begin_ns: int) -> NDArray[np.void]:
        """Return what was noted since a monotonic wall time [ns]: TRACE_DTYPE, shape (n,)."""
        records = np.concatenate([np.zeros(0, TRACE_DTYPE), *self._parts])
        # Nodes note by the system's clock.
        begin = 1e-9 * (begin_ns + time.time_ns() - time.monotonic_ns())
        return records[records["ended"] >= begin]

    def _take(self, data: bytes) -> None:
        try:
            records = decode_cloud(data, TRACE_DTYPE)[1]
        except MessageError as error:
            self._node.get_logger().warning(f"{topics.TRACE.name}: {error}")
            return
        usable = usable_records(records)
        if not usable.all():
            self._node.get_logger().warning(
                f"{topics.TRACE.name}: {np.count_nonzero(~usable)} records say nothing"
            )
        self._parts.append(records[usable])
