"""Record a run: every message raw, into a rosbag2 folder and into a buffer in memory."""

import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from errno import ENOENT
from pathlib import Path
from typing import Any, TypeVar

from rclpy.node import Node
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from winding_core.status import Level, Status
from winding_recorder.bags.description import reason
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.live.bag_series import BagSeries, RecorderError, Refusals, free_folder
from winding_recorder.live.run_buffer import PICTURES, BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.environment import ros_arguments
from winding_ros.message_guard import StampError
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.messages.stamps import encode_stamp, is_stamped, serialised_stamp_ns
from winding_ros.services import RECORD
from winding_ros.topic import PolledTopic, Taken, Topic

__all__ = ["BufferedMessage", "Recorder", "RecorderError", "RunBuffer"]

# Progress follows the topics that come often enough to show how far storage has come.
_FAST_RATE = 100.0
_ANSWER_PERIOD_NS = 20_000_000
# The histories hold two seconds; a look in a while costs less than a wake-up for each message.
_LOOK_PERIOD = 0.01
# An open chunk is stored, and the recorder's state published, at least this often (REP-107).
_REPORT_PERIOD_NS = 1_000_000_000
# Messages of one topic come in order; a machine that is built anew begins at zero.
_WENT_BACK_NS, _FAR_AHEAD_NS = 500_000_000, 10_000_000_000
_LATEST_NS = 2_147_483_000_000_000_000  # The end of the seconds of a stamp
# What waits for the disk; a simulated machine waits itself long before.
_MOST_WAITING = 256 * 1024 * 1024

Item = TypeVar("Item")
# A message with its topic and its own stamp [ns], None where it has none.
Found = tuple[Topic, int | None, Taken]


@dataclass(frozen=True, kw_only=True)
class RecordRequest:
    """A request to turn the recording on or off."""

    on: bool  # Which of the two
    # Takes whether it was done and a sentence; to be called once, from any thread.
    answer: Callable[[bool, str], None]


class RecordService:
    """Takes requests between messages, so that they are in order with what is recorded.

    Args:
        node: It must not be spun.
    """

    def __init__(self, node: Node) -> None:
        self._service = node.create_service(RECORD.type, RECORD.name, _called)

    def take(self) -> Iterator[RecordRequest]:
        """Yield the requests that wait."""
        while True:
            with self._service.handle:
                request, header = self._service.handle.service_take_request(SetBool.Request)
            if header is None:
                return
            yield RecordRequest(on=bool(request.data), answer=self._answering(header))

    def _answering(self, header: Any) -> Callable[[bool, str], None]:
        def answer(success: bool, message: str) -> None:
            self._service.send_response(SetBool.Response(success=success, message=message), header)

        return answer


def _called(_request: Any, _response: Any) -> Any:
    raise RuntimeError("the node of the recorder's service is spun")


class Recorder:
    """Stores what arrives on the recorded topics: one thread takes, another stores.

    Bag times are those of arrival; a message's own stamp is beside it as its time of publication.
    Whatever arrives is stored; what cannot be is counted and named, and nothing that a message
    holds ends the recording. A disk that is full or broken ends the bag and not the run: the
    buffer and the answers go on, `error` and /diagnostics report what happened.

    Args:
        node: Gives context and namespace to the recorder's own node, which is added to no executor.
        bag: New folder, or None for the buffer alone.
        recorded: Topics.
        config: How the bag is stored.
        notes: Texts about the run that the bag keeps, by name.
        further: Where bags go that the service recorder/record asks for, with a number where
            there is one already; None offers no service.
        on_demand: Topics that are taken only while a bag is being recorded.

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
        further: Path | None = None,
        on_demand: Iterable[Topic] = (),
    ) -> None:
        always = tuple(recorded)
        self._on_demand = tuple(topic for topic in on_demand if topic not in always)
        self._recorded = (*always, *self._on_demand)
        self._further = further
        self.buffer = RunBuffer(self._recorded)  # What has come so far
        namespace = node.get_namespace()
        self._hardware_id = namespace
        self._node = Node(
            topics.RECORDER,
            context=node.context,
            cli_args=ros_arguments(namespace.strip("/")),
            enable_rosout=False,
            start_parameter_services=False,
        )
        # What is recorded.
        self.bags = BagSeries(
            self._recorded,
            {
                topic.name: str(self._node.resolve_topic_name(topic.name))
                for topic in self._recorded
            },
            config or BagConfig(),
            notes or {},
        )
        # A look's messages at a time: the storing thread wakes up once for all of them.
        self._queue: queue.SimpleQueue[list[Found] | RecordRequest | None] = queue.SimpleQueue()
        self._requests = RecordService(self._node) if further is not None else None
        self._last_ns: dict[str, tuple[int, int]] = {}
        self._progress = topics.RECORDER_PROGRESS.advertise(self._node)
        self._diagnostics = topics.DIAGNOSTICS.advertise(self._node)
        self._stored_ns: dict[str, int] = {}
        self._answered_ns = -_ANSWER_PERIOD_NS
        self._newest_ns = 0
        self._reported_ns = time.monotonic_ns()
        self._unplaced = Refusals()
        self._found = self._dealt_with = 0
        self._found_bytes = self._dealt_with_bytes = 0
        self._stamped = frozenset(topic for topic in self._recorded if is_stamped(topic.type))
        self._fast = tuple(
            topic.name
            for topic in self._recorded
            if topic.rate is not None and topic.rate >= _FAST_RATE and topic.publisher == topics.RIG
        )
        self._followed = frozenset(self._fast) & {topic.name for topic in always}
        if bag is not None:
            self.bags.begin(bag)
        self._polled = [
            PolledTopic(self._node, topic) for topic in (always if bag is None else self._recorded)
        ]
        self._closing = threading.Event()
        self._taker = threading.Thread(target=self._take, name="recorder take", daemon=True)
        self._storer = threading.Thread(target=self._store, name="recorder store", daemon=True)
        self._taker.start()
        self._storer.start()

    def close(self) -> None:
        """Store everything that has arrived and close the bag; a failure is in `error`.

        The context must still be valid.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._taker.join()
        self._storer.join()
        self.bags.end()
        self.bags.join()
        self._node.destroy_node()

    @property
    def error(self) -> Exception | None:
        """What ended the bag before the run, if anything did."""
        return self.bags.error

    @property
    def lost(self) -> dict[str, int]:
        """Messages that were published after the first one and never arrived, by topic name."""
        return {name: count.lost for name, count in self.bags.losses.items()}

    @property
    def received(self) -> dict[str, int]:
        """Messages dealt with so far, by topic name, where one node publishes."""
        return {name: count.received for name, count in self.bags.losses.items()}

    @property
    def shortfalls(self) -> tuple[str, ...]:
        """What never arrived, could not be stored or has no place in the report, in sentences."""
        lost = {
            name: f"{count} messages never arrived" for name, count in self.lost.items() if count
        }
        return tuple(
            f"{name}: {sentence}"
            for found in (
                lost,
                self.bags.refused.sentences("could not be stored"),
                self._unplaced.sentences("are not in the report"),
            )
            for name, sentence in found.items()
        )

    def _take(self) -> None:
        """Take what has arrived, again and again; once more after `close` was called."""
        last = False
        while not last:
            last = self._closing.wait(_LOOK_PERIOD)
            found = [
                item
                for polled in self._polled
                for item in self._guarded(polled.topic.name, self._taken(polled))
            ]
            if found:
                # Topics are taken one by one, and a new run begins with the first message of any.
                found.sort(key=lambda item: item[2].received_ns)
                self._found += len(found)
                self._found_bytes += sum(len(taken.data) for _, _, taken in found)
                self._queue.put(found)
            requests = self._requests.take() if self._requests is not None else iter(())
            for request in self._guarded(RECORD.name, requests):
                self._take_on_demand(request.on)
                self._queue.put(request)
        self._queue.put(None)

    def _guarded(self, name: str, items: Iterator[Item]) -> Iterator[Item]:
        """Yield what there is; note why there is no more of it."""
        try:
            yield from items
        except Exception as error:  # noqa: BLE001 - the other topics are taken all the same
            self.bags.refused.add(name, reason(error))

    def _taken(self, polled: PolledTopic) -> Iterator[Found]:
        """Yield what waits on a topic, with its stamps [ns]; the buffer has it by then."""
        topic = polled.topic
        for taken in polled.take():
            stamp = self._stamp_of(topic, taken)
            waiting = self._found_bytes - self._dealt_with_bytes
            if waiting > _MOST_WAITING and topic in PICTURES:
                # A machine that waits for no reader would fill the memory.
                self.bags.refused.add(topic.name, f"{waiting} bytes waited for the disk")
                continue
            yield topic, stamp, taken

    def _stamp_of(self, topic: Topic, taken: Taken) -> int | None:
        """Return a message's own stamp [ns], None where it has none; the buffer has it by then."""
        stamp = None
        try:
            if topic in self._stamped:
                stamp = serialised_stamp_ns(taken.data)
            # Supervision looks at the buffer, which must not wait for a disk.
            placed = taken.arrived_at_ns if stamp is None else stamp
            self.buffer.add(
                topic, BufferedMessage(placed, taken.sent_ns, taken.received_ns, taken.data)
            )
        except StampError as error:
            # External nodes may publish any bytes.
            self._unplaced.add(topic.name, str(error))
        return stamp

    def _take_on_demand(self, on: bool) -> None:
        """Take what is only recorded, or take it no longer."""
        present = [polled for polled in self._polled if polled.topic in self._on_demand]
        if on and not present:
            self._polled += [PolledTopic(self._node, topic) for topic in self._on_demand]
        if not on:
            self._polled = [polled for polled in self._polled if polled not in present]
            for polled in present:
                polled.close()

    def _store(self) -> None:
        while True:
            try:
                item = self._queue.get(timeout=1e-9 * _REPORT_PERIOD_NS)
            except queue.Empty:
                self._report(time.monotonic_ns())
                continue
            if item is None:
                return
            if isinstance(item, RecordRequest):
                self._turn(item)
                continue
            for topic, stamp, taken in item:
                self._store_one(topic, stamp, taken)
            self._dealt_with += len(item)
            self._dealt_with_bytes += sum(len(taken.data) for _, _, taken in item)
            now = time.monotonic_ns()
            if now - self._reported_ns >= _REPORT_PERIOD_NS:
                self._report(now)

    def _store_one(self, topic: Topic, stamp: int | None, taken: Taken) -> None:
        if stamp is not None:
            if self._further is not None:
                self._follow_time(topic, stamp, taken.received_ns)
            if topic.publisher == topics.RIG:
                self._newest_ns = stamp
        try:
            self.bags.take(topic, stamp, taken)
        except OSError as error:
            self._fail(error)
        except Exception as error:  # noqa: BLE001 - the messages behind it are stored all the same
            self.bags.refused.add(topic.name, reason(error))
        if stamp is not None and topic.name in self._fast:
            self._answer(topic, stamp)

    def _turn(self, request: RecordRequest) -> None:
        """Begin a bag or end it; the answer comes when that is done."""
        if request.on:
            try:
                request.answer(True, f"recording into {self._begin()}")
            except RecorderError as error:
                request.answer(False, str(error))
        else:
            for topic in self._on_demand:
                self._stored_ns.pop(topic.name, None)
            self.bags.leave(request.answer)
        self._publish_state()

    def _begin(self) -> Path:
        """Return the bag that is being recorded; begin one if there is none."""
        if self.bags.writer is None:
            assert self._further is not None
            self.bags.begin(free_folder(self._further))
        return self.bags.folders[-1]

    def _follow_time(self, topic: Topic, stamp: int, received: int) -> None:
        """Begin another bag when time has gone back: each has one course of time."""
        if topic.name not in self.bags.losses:
            return
        last, before = self._last_ns.get(topic.name, (stamp, received))
        if not 0 <= stamp <= last + _FAR_AHEAD_NS:
            # It is no time of the run.
            return
        self._last_ns[topic.name] = (stamp, received)
        if stamp >= last - _WENT_BACK_NS:
            return
        self._last_ns = {topic.name: (stamp, received)}
        self._stored_ns.clear()
        # Latched messages that came before a new run belong into its bag, too.
        self.bags.forget(before)
        self._answered_ns, self._newest_ns = -_ANSWER_PERIOD_NS, 0
        if self.bags.writer is None:
            return
        self.bags.leave(lambda _done, _sentence: None, before)
        try:
            self._begin()
        except RecorderError as error:
            self.bags.error = error

    def _fail(self, error: OSError) -> None:
        """End the bag where it stands; the run goes on."""
        self.bags.error = error
        why = f"no: {error.strerror or error} at {self._newest_ns * 1e-9:.3f} s"
        self.bags.leave(lambda _done, _sentence: None, failure=why)
        self._publish_state()

    def _report(self, now: int) -> None:
        self._reported_ns = now
        if self.bags.writer is not None:
            try:
                if self.bags.gone:
                    raise FileNotFoundError(ENOENT, "the bag was removed")
                self.bags.writer.flush()
            except OSError as error:
                self._fail(error)
                return
        self._publish_state()

    def _publish_state(self) -> None:
        lost = sum(self.lost.values())
        writer = self.bags.writer
        level, message = Level.OK, "recording" if writer is not None else "no bag"
        if shortfalls := self.shortfalls:
            level, message = Level.WARN, "; ".join(shortfalls)
        if self.error is not None and writer is None:
            level, message = Level.ERROR, f"the recording has ended: {self.error}"
        values = {"lost": str(lost), "waiting": str(self._found - self._dealt_with)}
        if level is Level.ERROR:
            values["ended"] = str(self.error)
        if writer is not None:
            values |= {"messages": str(writer.taken), "bytes": str(writer.stored)}
            values["bag"] = writer.folder.name
        status = Status(name=topics.RECORDER, level=level, message=message, values=values)
        self._diagnostics.publish(
            encode_diagnostics(
                min(self._newest_ns, _LATEST_NS) * 1e-9, [status], hardware_id=self._hardware_id
            )
        )

    def _answer(self, topic: Topic, stamp_ns: int) -> None:
        if stamp_ns < self._stored_ns.get(topic.name, stamp_ns):
            # Time has gone back, or was far ahead.
            self._stored_ns.clear()
            self._answered_ns = -_ANSWER_PERIOD_NS
        self._stored_ns[topic.name] = stamp_ns
        if not self._followed <= self._stored_ns.keys():
            return
        reached = min(self._stored_ns.values())
        # A topic that joins the others may lie behind what was answered.
        if reached - self._answered_ns >= _ANSWER_PERIOD_NS:
            self._answered_ns = reached
            self._progress.publish(Header(stamp=encode_stamp(min(reached, _LATEST_NS) * 1e-9)))
