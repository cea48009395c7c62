"""Publish a recording again: the same bytes, the same rhythm."""

import importlib
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger

from winding_core.status import PLAYBACK, Status
from winding_recorder.bags.description import BagError, reason
from winding_recorder.bags.reading import messages_of, opened
from winding_recorder.playback.publishers import drain, refuse_rivals, wait_for_subscribers
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.messages.stamps import encode_stamp
from winding_ros.topics import CLOCK, DIAGNOSTICS

_CLOCK_PERIOD = 0.01
_LOOK_PERIOD = 0.05  # Pause and end are noticed this often [s]
# What came in this time before a place is published at once when the playback goes there [s]: every
# topic but the latched ones has published its newest.
_BEFORE = 1.2
_REPORT_PERIOD = 0.2
_NANO = 1e9
_DEPTH, _DEEPEST = 1000, 100_000


class Pacing:
    """Maps bag times to the wall clock.

    Args:
        rate: Bag seconds per wall second, positive.
        paused: Whether time stands still at first.
    """

    def __init__(self, rate: float, *, paused: bool = False) -> None:
        if not 0.0 < rate < float("inf"):
            raise ValueError(f"rate must be positive and finite, got {rate:g}")
        self._rate = rate
        self._paused = paused
        self._anchor: tuple[float, float] | None = None

    @property
    def paused(self) -> bool:
        """Whether time stands still."""
        return self._paused

    def start(self, bag_time: float, now: float) -> None:
        """Let bag time [s] be at `bag_time` at time `now` [s] of the clock."""
        self._anchor = (bag_time, now)

    def bag_time(self, now: float) -> float:
        """Return the bag time [s] that has been reached.

        Raises:
            RuntimeError: Playback has not begun.
        """
        if self._anchor is None:
            raise RuntimeError("playback has not begun")
        bag_time, since = self._anchor
        return bag_time if self._paused else bag_time + self._rate * (now - since)

    def wait(self, bag_time: float, now: float) -> float | None:
        """Return how long [s] until a bag time is reached; None while paused."""
        if self._paused:
            return None
        return max(0.0, bag_time - self.bag_time(now)) / self._rate

    def set_paused(self, paused: bool, now: float) -> None:
        """Stop or go on; what passed on the wall clock in between does not count."""
        if self._anchor is not None:
            self._anchor = (self.bag_time(now), now)
        self._paused = paused


class Player:
    """Publishes the topics of a recording on a node, /clock and its place in /diagnostics.

    Services: ~/set_paused (std_srvs/SetBool) and ~/toggle_paused (std_srvs/Trigger). The playback
    goes where the parameter `position` is set to [s from its beginning].

    Args:
        node: Spun by the caller.
        bag: The recording.
        pacing: Rate and pause.
        wanted: Full topic names; empty for all.
        force: Publish although the topics have publishers.

    Raises:
        BagError: The recording cannot be read, lacks a topic, or another node publishes one.
    """

    def __init__(
        self,
        node: Node,
        bag: Path,
        pacing: Pacing,
        *,
        wanted: frozenset[str] = frozenset(),
        force: bool = False,
    ) -> None:
        self._node = node
        self._bag = bag
        self._pacing = pacing
        self._lock = threading.Lock()
        self.published = 0
        self.latest = 0.0
        with opened(bag) as reader:
            links = [link for link in reader.connections if not wanted or link.topic in wanted]
            known = {link.topic for link in reader.connections}
        if missing := sorted(wanted - known):
            raise BagError(f"{bag} has no topic {missing[0]}; it has {', '.join(sorted(known))}")
        self._topics = frozenset(link.topic for link in links)
        names = sorted(self._topics | {CLOCK.name})
        if not force:
            refuse_rivals(node, names)
        self._publishers = {link.topic: self._publisher(link) for link in links}
        self._span = (0.0, 0.0)
        self._sought: float | None = None
        self._clock: Publisher | None = None
        if CLOCK.name not in self._publishers:
            self._clock = node.create_publisher(Clock, CLOCK.name, CLOCK.qos)
        node.create_service(SetBool, "~/set_paused", self._on_set_paused)
        node.create_service(Trigger, "~/toggle_paused", self._on_toggle)
        node.declare_parameter("position", 0.0)
        node.add_on_set_parameters_callback(self._on_set)
        self._diagnostics = DIAGNOSTICS.advertise(node)
        node.create_timer(_REPORT_PERIOD, self._report)

    def toggle(self) -> bool:
        """Pause or go on; return whether it is paused now. From any thread."""
        with self._lock:
            self._pacing.set_paused(not self._pacing.paused, time.monotonic())
            return self._pacing.paused

    def wait_for_subscribers(self) -> None:
        """Wait until every subscriber that the graph knows has found its publisher."""
        wait_for_subscribers(self._node, self._publishers.values())

    def drain(self) -> None:
        """Wait until subscribers have everything, for a limited time."""
        drain(self._publishers.values())

    def play(self, stopped: Callable[[], bool]) -> None:
        """Publish the recording once, as it arrived.

        What came before the busiest topic, while the graph was started, is published at once.

        Raises:
            BagError: The recording is damaged.
        """
        with opened(self._bag) as reader:
            links = [link for link in reader.connections if link.topic in self._topics]
            if not any(link.msgcount for link in links):
                return
            begin = _begin(reader, links)
            place: float | None = begin
            while place is not None and not stopped():
                with self._lock:
                    self._span = (begin, max(begin, reader.end_time / _NANO))
                    self._sought = None
                    self._pacing.start(place, time.monotonic())
                self._play_from(reader, links, place, None if place == begin else place, stopped)
                place = self._sought

    def _play_from(
        self,
        reader: AnyReader,
        links: Sequence[Any],
        begin: float,
        sought: float | None,
        stopped: Callable[[], bool],
    ) -> None:
        """Publish from a bag time [s] until the end, or until another place is asked for.

        Args:
            reader: Of the recording.
            links: What is published.
            begin: Bag time [s].
            sought: The same where others went before it, so that latched topics are published anew.
            stopped: Whether to end early.
        """
        start = None if sought is None else round((sought - _BEFORE) * _NANO)
        for link in links if start is not None else ():
            if _offered(link).durability is DurabilityPolicy.TRANSIENT_LOCAL:
                for _, _, data in deque(messages_of(reader, [link], stop=start), maxlen=1):
                    self._publish(link, data)
        tick = -_CLOCK_PERIOD
        for link, arrived, data in messages_of(reader, links, start=start):
            due = max(arrived / _NANO, begin)
            if due == sought:
                self._publish(link, data)
                continue
            while self._clock is not None and tick + _CLOCK_PERIOD < due:
                tick = max(tick + _CLOCK_PERIOD, begin)
                if not self._until(tick, stopped):
                    return
                self._clock.publish(Clock(clock=encode_stamp(tick)))
            if not self._until(due, stopped):
                return
            self._publish(link, data)

    def _publish(self, link: Any, data: bytes) -> None:
        try:
            self._publishers[link.topic].publish(data)
        except Exception as error:
            # What the middleware raises on damaged bytes is private to rclpy.
            raise BagError(f"{link.topic}: cannot be published: {reason(error)}") from error
        self.published += 1

    def _until(self, due: float, stopped: Callable[[], bool]) -> bool:
        """Wait for a bag time [s]; return False when the playback was stopped or goes elsewhere."""
        while not stopped():
            with self._lock:
                if self._sought is not None:
                    return False
                now = time.monotonic()
                wait = self._pacing.wait(due, now)
                if wait == 0.0:
                    self.latest = max(self.latest, self._pacing.bag_time(now) - due)
                    return True
            time.sleep(_LOOK_PERIOD if wait is None else min(wait, _LOOK_PERIOD))
        return False

    def _publisher(self, link: Any) -> Publisher:
        try:
            package, kind, name = link.msgtype.split("/")
            message = getattr(importlib.import_module(f"{package}.{kind}"), name)
        except (ImportError, AttributeError, ValueError) as error:
            raise BagError(
                f"{link.topic} is a {link.msgtype}, which is not installed; leave it out with "
                "--topics"
            ) from error
        return self._node.create_publisher(message, link.topic, _offered(link))

    def _report(self) -> None:
        with self._lock:
            begin, end = self._span
            if end == 0.0:
                return
            place = min(self._pacing.bag_time(time.monotonic()), end)
            values = {"position": place - begin, "length": end - begin}
            values["paused"] = float(self._pacing.paused)
        status = Status(
            name=PLAYBACK, values={name: f"{value:.3f}" for name, value in values.items()}
        )
        self._diagnostics.publish(encode_diagnostics(place, [status]))

    def _on_set(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for wanted in (item for item in parameters if item.name == "position"):
            with self._lock:
                begin, end = self._span
                if not 0.0 <= wanted.value <= end - begin:
                    limits = f"from 0 to {end - begin:.1f} s, got {wanted.value:g}"
                    return SetParametersResult(
                        successful=False, reason=f"position must be {limits}"
                    )
                self._sought = begin + wanted.value
        return SetParametersResult(successful=True)

    def _on_set_paused(self, request: Any, response: Any) -> Any:
        with self._lock:
            self._pacing.set_paused(request.data, time.monotonic())
        response.success = True
        return response

    def _on_toggle(self, request: Any, response: Any) -> Any:
        response.success = True
        response.message = "paused" if self.toggle() else "playing"
        return response


def _begin(reader: AnyReader, links: Sequence[Any]) -> float:
    """Return the bag time [s] at which the busiest topic begins."""
    busiest = max(links, key=lambda link: link.msgcount)
    _, arrived, _ = next(messages_of(reader, [busiest]))
    return arrived * 1e-9


def _offered(link: Any) -> QoSProfile:
    profiles = link.ext.offered_qos_profiles
    if not profiles:
        return QoSProfile(depth=_DEPTH)
    (offered, *_) = profiles
    latched = offered.durability.name == "TRANSIENT_LOCAL"
    reliable = offered.reliability.name != "BEST_EFFORT"
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=min(max(1, offered.depth), _DEEPEST),
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
