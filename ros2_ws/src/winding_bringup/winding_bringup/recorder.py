"""Record a run: every message raw, into a rosbag2 MCAP bag and onto a tape in memory."""

from __future__ import annotations

import queue
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from rclpy.node import Node
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import Header

from cable_winding.ros import topics
from cable_winding.ros.stamps import encode_stamp, serialised_stamp_ns
from cable_winding.ros.topics import Topic

_BAG_VERSION = 9
_FOREVER = QosTime(sec=9223372036, nsec=854775807)
# Progress follows the topics that come often enough to say how far storage has come.
_FAST_RATE = 100.0
_ANSWER_PERIOD_NS = 20_000_000


class RecorderError(ValueError):
    """The recording cannot begin where it was asked to."""


@dataclass(frozen=True, kw_only=True)
class TapedMessage:
    """One serialised message.

    Attributes:
        stamp_ns: Its own stamp [ns].
        received_ns: Monotonic wall time of its arrival [ns].
        data: CDR bytes.
    """

    stamp_ns: int
    received_ns: int
    data: bytes


class Tape:
    """Messages of a run in memory, by topic name; pictures are left to the bag."""

    def __init__(self) -> None:
        self.messages: dict[str, list[TapedMessage]] = defaultdict(list)

    def last(self, topic: Topic) -> TapedMessage | None:
        """Return the newest message of a topic."""
        messages = self.messages.get(topic.name)
        return messages[-1] if messages else None

    def last_stamp(self, topic: Topic) -> float:
        """Return the newest stamp of a topic [s], or -1 when there is none yet."""
        message = self.last(topic)
        return message.stamp_ns * 1e-9 if message else -1.0


class Recorder:
    """Stores what arrives on the recorded topics, in a thread of its own.

    Bag times are the messages' own stamps: simulated time, whatever the wall clock did.
    """

    def __init__(self, node: Node, bag: Path | None, *, recorded: Iterable[Topic]) -> None:
        self.tape = Tape()
        self._writer: Writer | None = None
        self._connections: dict[str, Connection] = {}
        self._queue: queue.SimpleQueue[tuple[Topic, bytes, int] | None] = queue.SimpleQueue()
        self._progress = topics.RECORDER_PROGRESS.advertise(node)
        self._stored_ns: dict[str, int] = {}
        self._answered_ns = -_ANSWER_PERIOD_NS
        self._error: Exception | None = None
        recorded = tuple(recorded)
        self._fast = tuple(
            topic.name
            for topic in recorded
            if topic.rate is not None and topic.rate >= _FAST_RATE and topic.publisher == topics.RIG
        )
        if bag is not None:
            self._open(bag, recorded, node)
        for topic in recorded:
            topic.subscribe(node, self._take(topic), raw=True)
        self._thread = threading.Thread(target=self._store, name="recorder", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Store everything that has arrived and close the bag.

        Raises:
            OSError: The bag could not be written to its end.
        """
        self._queue.put(None)
        self._thread.join()
        if self._writer is not None:
            self._writer.close()
        if self._error is not None:
            raise self._error

    @property
    def error(self) -> Exception | None:
        """What stopped the storage, if anything did."""
        return self._error

    def _open(self, bag: Path, recorded: Iterable[Topic], node: Node) -> None:
        if bag.exists():
            raise RecorderError(f"{bag} exists already; a recording is never overwritten")
        bag.parent.mkdir(parents=True, exist_ok=True)
        types = get_typestore(Stores.ROS2_JAZZY)
        self._writer = Writer(bag, version=_BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        for topic in recorded:
            self._connections[topic.name] = self._writer.add_connection(
                node.resolve_topic_name(topic.name),
                topic.type_name,
                typestore=types,
                offered_qos_profiles=[_offered(topic)],
            )

    def _take(self, topic: Topic) -> Callable[[bytes], None]:
        put = self._queue.put
        return lambda data: put((topic, data, time.monotonic_ns()))

    def _store(self) -> None:
        while (item := self._queue.get()) is not None:
            topic, data, received = item
            stamp = serialised_stamp_ns(data)
            if topic not in _PICTURES:
                self.tape.messages[topic.name].append(
                    TapedMessage(stamp_ns=stamp, received_ns=received, data=data)
                )
            if self._writer is not None and self._error is None:
                try:
                    self._writer.write(self._connections[topic.name], stamp, data)
                except OSError as error:
                    # The run goes on; the orchestrator reads `error` and reports it.
                    self._error = error
            if topic.name in self._fast:
                self._answer(topic, stamp)

    def _answer(self, topic: Topic, stamp_ns: int) -> None:
        self._stored_ns[topic.name] = stamp_ns
        if len(self._stored_ns) < len(self._fast):
            return
        reached = min(self._stored_ns.values())
        if reached - self._answered_ns >= _ANSWER_PERIOD_NS:
            self._answered_ns = reached
            self._progress.publish(Header(stamp=encode_stamp(reached * 1e-9)))


_PICTURES = (topics.IMAGE, topics.PREVIEW)


def _offered(topic: Topic) -> Qos:
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=topic.depth,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if topic.latched else QosDurability.VOLATILE,
        deadline=_FOREVER,
        lifespan=_FOREVER,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_FOREVER,
        avoid_ros_namespace_conventions=False,
    )
