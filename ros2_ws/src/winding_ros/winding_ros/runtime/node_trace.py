"""A node's part of the trace: when it took, made and published what a corrected length needs."""

import time
from collections import deque

import numpy as np
from rclpy.node import Node

from winding_core.trace import STAMPED_BY_CLOCK, TRACE_DTYPE, Channel, Station, TraceEvent
from winding_ros import topics
from winding_ros.messages.clouds import encode_cloud
from winding_ros.messages.stamps import serialised_stamp
from winding_ros.topic import Delivered, Topic

_CHANNELS = {
    topics.IMAGE.name: Channel.FRAME,
    topics.JOINT_STATES.name: Channel.JOINT_STATES,
    topics.TRACKED_MARKERS.name: Channel.TRACKED,
    topics.FEM_MARKERS.name: Channel.PREDICTED,
    topics.CORRECTED_MARKERS.name: Channel.CORRECTED,
}
_STATIONS = {
    topics.RIG: Station.RIG,
    topics.FEM: Station.SOLVER,
    topics.TRACKER: Station.TRACKER,
    topics.CORRECTION: Station.CORRECTION,
}
_Record = tuple[int, int, int, float, float, float, float, float]


def now_ns() -> int:
    """Return the time of the system, the clock of every instant noted here [ns]."""
    return time.time_ns()


class NodeTrace:
    """Notes instants while the topic `trace` has a subscription, and publishes them in batches.

    Methods may be called from any thread.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self._station = _STATIONS.get(name)
        self._publisher = topics.TRACE.advertise(node) if self._station is not None else None
        self._records: deque[_Record] = deque()
        self._published = 0
        self.wanted = False

    def exposed(self, t: float, began_ns: int) -> None:
        """Note that the pixels of a frame of time t [s] are there.

        Args:
            t: Its stamp [s].
            began_ns: When the machine stood as it shows, by `now_ns`.
        """
        if self.wanted:
            self._note(TraceEvent.EXPOSED, Channel.FRAME, t, began_ns=began_ns)

    def shown(self, t: float, instant: float) -> None:
        """Note the instant [s] that a frame stamped t [s] shows, where that is by this clock."""
        if 0.0 <= 1.0e-9 * now_ns() - instant < STAMPED_BY_CLOCK:
            self.exposed(t, round(1.0e9 * instant))

    def published(self, topic: Topic, data: bytes, began_ns: int) -> None:
        """Note that a message, in CDR bytes, has been published just now."""
        channel = _CHANNELS.get(topic.name)
        if channel is None:
            return
        self._published += 1
        # Every joint state of the machine would be a thousand records a second; DDS reports when
        # those were sent of which a prediction was made.
        if channel is not Channel.JOINT_STATES:
            self._note(TraceEvent.PUBLISHED, channel, serialised_stamp(data), began_ns=began_ns)

    def taking(self) -> tuple[int, int]:
        """Return what `taken` needs to know of the beginning of a callback."""
        return time.time_ns(), self._published

    def taken(self, topic: Topic, delivered: Delivered, began: tuple[int, int]) -> None:
        """Note that the callback of a message has come to its end just now."""
        channel = _CHANNELS.get(topic.name)
        began_ns, published = began
        # Of joint states only those count that something was made of.
        if channel is None or (channel is Channel.JOINT_STATES and published == self._published):
            return
        self._note(
            TraceEvent.TAKEN,
            channel,
            serialised_stamp(delivered.data),
            sent_ns=delivered.sent_ns,
            arrived_ns=delivered.arrived_ns,
            began_ns=began_ns,
        )

    def publish(self) -> None:
        """Publish what has been noted, and look whether anybody listens."""
        if self._publisher is None:
            return
        # Other threads note meanwhile.
        records = [self._records.popleft() for _ in range(len(self._records))]
        if records:
            self._publisher.publish(
                encode_cloud(
                    self._node.get_clock().now().nanoseconds * 1e-9,
                    np.array(records, dtype=TRACE_DTYPE),
                )
            )
        self.wanted = self._publisher.get_subscription_count() > 0

    def handed_over(self, topic: Topic, t: float, began: tuple[int, int]) -> None:
        """Note that a message of time t [s] was dealt with that came from the same process."""
        began_ns, _ = began
        if self.wanted:
            self._note(
                TraceEvent.TAKEN,
                _CHANNELS[topic.name],
                t,
                sent_ns=began_ns,
                arrived_ns=began_ns,
                began_ns=began_ns,
            )

    def _note(
        self,
        event: TraceEvent,
        channel: Channel,
        stamp: float,
        *,
        began_ns: int,
        sent_ns: int = 0,
        arrived_ns: int = 0,
    ) -> None:
        assert self._station is not None
        instants = (sent_ns, arrived_ns, began_ns, time.time_ns())
        sent, arrived, began, ended = (1e-9 * instant for instant in instants)
        self._records.append((event, channel, self._station, stamp, sent, arrived, began, ended))
