"""Record a run: every message raw, into a rosbag2 folder and onto a tape in memory."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

from rclpy.node import Node
from std_msgs.msg import Header

from cable_winding.intake import StampError
from cable_winding.ros import topics
from cable_winding.ros.diagnostic_messages import Level, Status, encode_diagnostics
from cable_winding.ros.polled import PolledTopic, Taken
from cable_winding.ros.stamps import encode_stamp, serialised_stamp_ns
from cable_winding.ros.topics import Topic
from winding_bringup.bags.bag_file import BagConfig
from winding_bringup.bags.channel import jazzy_channel
from winding_bringup.bags.failure import BagError
from winding_bringup.bags.loss import LossCount
from winding_bringup.bags.notes import COMPLETE, LOST, YES
from winding_bringup.bags.writer import BagWriter
from winding_bringup.environment import ros_arguments
from winding_bringup.tape import Tape, TapedMessage

__all__ = ["Recorder", "RecorderError", "Tape", "TapedMessage"]

# Progress follows the topics that come often enough to say how far storage has come.
_FAST_RATE = 100.0
_ANSWER_PERIOD_NS = 20_000_000
# The readers' histories hold two seconds; looking costs nothing beside one wake-up per message.
_LOOK_PERIOD = 0.004
# An open chunk is stored at least this often, and the recorder's state told (REP-107).
_TELL_PERIOD_NS = 1_000_000_000


class RecorderError(BagError):
    """The recording cannot begin where it was asked to."""


class Recorder:
    """Stores what arrives on the recorded topics: one thread takes, another stores.

    Bag times are the messages' own stamps: simulated time, whatever the wall clock did. A disk
    that is full or broken ends the bag and not the run: the tape and the answers go on, `error`
    and /diagnostics say what happened.

    Args:
        node: Gives context and namespace to the recorder's own node, which nobody spins.
        bag: New folder, or None for the tape alone.
        recorded: Topics.
        config: How the bag is stored.
        notes: What the bag says of the run, by name.

    Raises:
        RecorderError: The folder exists, or nothing can be written there.
    """

    def __init__(
        self,
        node: Node,
        bag: Path | None,
        *,
        recorded: Iterable[Topic],
        config: BagConfig | None = None,
        notes: Mapping[str, str] | None = None,
    ) -> None:
        self._recorded = tuple(recorded)
        self.tape = Tape(self._recorded)
        namespace = node.get_namespace()
        self._hardware_id = namespace
        self._node = Node(
            topics.RECORDER,
            context=node.context,
            cli_args=ros_arguments(namespace.strip("/")),
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._index = {topic.name: k for k, topic in enumerate(self._recorded)}
        self._full_names = {
            topic.name: str(self._node.resolve_topic_name(topic.name)) for topic in self._recorded
        }
        self._losses = {
            topic.name: LossCount()
            for topic in self._recorded
            if topic.publisher != topics.EVERY_NODE
        }
        self._queue: queue.SimpleQueue[tuple[Topic, int, Taken] | None] = queue.SimpleQueue()
        self._progress = topics.RECORDER_PROGRESS.advertise(self._node)
        self._diagnostics = topics.DIAGNOSTICS.advertise(self._node)
        self._stored_ns: dict[str, int] = {}
        self._answered_ns = -_ANSWER_PERIOD_NS
        self._newest_ns = 0
        self._told_ns = time.monotonic_ns()
        self._error: Exception | None = None
        self._unstamped = 0
        self._fast = tuple(
            topic.name
            for topic in self._recorded
            if topic.rate is not None and topic.rate >= _FAST_RATE and topic.publisher == topics.RIG
        )
        self._writer = None if bag is None else self._open(bag, config or BagConfig(), notes or {})
        self._polled = [PolledTopic(self._node, topic) for topic in self._recorded]
        self._closing = threading.Event()
        self._taker = threading.Thread(target=self._take, name="recorder take", daemon=True)
        self._storer = threading.Thread(target=self._store, name="recorder store", daemon=True)
        self._taker.start()
        self._storer.start()

    def close(self) -> None:
        """Store everything that has arrived and close the bag; `error` says if that failed.

        The context must still be valid.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._taker.join()
        self._storer.join()
        self._end("")
        self._node.destroy_node()

    @property
    def error(self) -> Exception | None:
        """What ended the bag before the run, if anything did."""
        return self._error

    @property
    def lost(self) -> dict[str, int]:
        """Messages that were published after the first one and never arrived, by topic name."""
        return {name: count.lost for name, count in self._losses.items()}

    @property
    def received(self) -> dict[str, int]:
        """Messages dealt with so far, by topic name, where one node publishes."""
        return {name: count.received for name, count in self._losses.items()}

    def _open(self, bag: Path, config: BagConfig, notes: Mapping[str, str]) -> BagWriter:
        channels = [
            jazzy_channel(
                self._full_names[topic.name],
                topic.type_name,
                depth=topic.depth,
                latched=topic.latched,
            )
            for topic in self._recorded
        ]
        try:
            return BagWriter(bag, channels, config, notes)
        except OSError as error:
            raise RecorderError(f"cannot record into {bag}: {error.strerror or error}") from error
        except BagError as error:
            raise RecorderError(str(error)) from error

    def _take(self) -> None:
        """Take what has arrived, again and again; once more after `close` was called."""
        last = False
        while not last:
            last = self._closing.wait(_LOOK_PERIOD)
            for polled in self._polled:
                topic = polled.topic
                for taken in polled.take():
                    try:
                        stamp = serialised_stamp_ns(taken.data)
                    except StampError:
                        # A stranger may publish any bytes; without a stamp they have no place.
                        self._unstamped += 1
                        continue
                    # Supervision looks at the tape, which must not wait for a disk.
                    self.tape.add(
                        topic,
                        TapedMessage(
                            stamp_ns=stamp,
                            sent_ns=taken.sent_ns,
                            received_ns=taken.received_ns,
                            data=taken.data,
                        ),
                    )
                    self._queue.put((topic, stamp, taken))
        self._queue.put(None)

    def _store(self) -> None:
        while True:
            try:
                item = self._queue.get(timeout=1e-9 * _TELL_PERIOD_NS)
            except queue.Empty:
                self._tell(time.monotonic_ns())
                continue
            if item is None:
                return
            topic, stamp, taken = item
            if topic.publisher == topics.EVERY_NODE:
                # Strangers publish there too, and their clocks are their own.
                stamp = min(stamp, self._newest_ns)
            self._newest_ns = max(self._newest_ns, stamp)
            if topic.name in self._losses:
                self._losses[topic.name].take(taken.number)
            if self._writer is not None:
                try:
                    self._writer.write(self._index[topic.name], stamp, taken.data, taken.number)
                except OSError as error:
                    self._fail(error)
            if topic.name in self._fast:
                self._answer(topic, stamp)
            now = time.monotonic_ns()
            if now - self._told_ns >= _TELL_PERIOD_NS:
                self._tell(now)

    def _fail(self, error: OSError) -> None:
        """End the bag where it stands; the run goes on."""
        self._error = error
        self._end(f"no: {error.strerror or error} at {self._newest_ns * 1e-9:.3f} s")
        self._publish_state()

    def _end(self, failure: str) -> None:
        writer, self._writer = self._writer, None
        if writer is None:
            return
        notes = {COMPLETE: failure or YES}
        for name, count in self._losses.items():
            notes[f"{LOST}{self._full_names[name]}"] = str(count.lost)
        try:
            writer.close(notes)
        except OSError as error:
            self._error = OSError(
                error.errno,
                f"{error.strerror or error}; the bag was not closed, "
                f"`winding bag recover {writer.folder}` reads what there is",
            )

    def _tell(self, now: int) -> None:
        self._told_ns = now
        if self._writer is not None:
            try:
                self._writer.flush()
            except OSError as error:
                self._fail(error)
                return
        self._publish_state()

    def _publish_state(self) -> None:
        lost = sum(count.lost for count in self._losses.values())
        level, message = Level.OK, "recording" if self._writer is not None else "no bag"
        if lost:
            level, message = Level.WARN, f"{lost} messages never arrived"
        if self._unstamped:
            level, message = Level.WARN, f"{self._unstamped} messages had no stamp"
        if self._error is not None:
            level, message = Level.ERROR, f"the recording has ended: {self._error}"
        values = {"lost": str(lost), "waiting": str(self._queue.qsize())}
        if self._writer is not None:
            values |= {"messages": str(self._writer.taken), "bytes": str(self._writer.stored)}
        status = Status(name=topics.RECORDER, level=level, message=message, values=values)
        self._diagnostics.publish(
            encode_diagnostics(self._newest_ns * 1e-9, [status], hardware_id=self._hardware_id)
        )

    def _answer(self, topic: Topic, stamp_ns: int) -> None:
        self._stored_ns[topic.name] = stamp_ns
        if len(self._stored_ns) < len(self._fast):
            return
        reached = min(self._stored_ns.values())
        if reached - self._answered_ns >= _ANSWER_PERIOD_NS:
            self._answered_ns = reached
            self._progress.publish(Header(stamp=encode_stamp(reached * 1e-9)))
