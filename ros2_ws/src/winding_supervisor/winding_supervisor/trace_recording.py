"""Keeps what the nodes say of the way of each corrected length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from winding_core.trace import TRACE_DTYPE
from winding_ros import topics
from winding_ros.cloud_messages import decode_cloud
from winding_ros.message_error import MessageError


class TraceRecording:
    """Listens to the nodes' traces; they note nothing while nobody does.

    Args:
        node: Spun by somebody else.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._parts: list[NDArray[np.void]] = []
        topics.TRACE.subscribe(node, self._take, raw=True)

    @property
    def records(self) -> NDArray[np.void]:
        """What has come so far: TRACE_DTYPE, shape (n,)."""
        return np.concatenate([np.zeros(0, TRACE_DTYPE), *self._parts])

    def _take(self, data: bytes) -> None:
        try:
            self._parts.append(decode_cloud(data, TRACE_DTYPE)[1])
        except MessageError as error:
            self._node.get_logger().warning(f"{topics.TRACE.name}: {error}")
