"""Publishers, subscriptions and stop requests of a managed node: guarded, matched, contested."""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from winding_core.status import Level, Status
from winding_ros.graph import NodeSpec
from winding_ros.message_guard import Endpoint, MessageGuard, Rivals, StampError, topic_status
from winding_ros.messages.cdr import serialised
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import decode_stamp, serialised_stamp
from winding_ros.runtime.heartbeat import Heartbeat
from winding_ros.runtime.inputs import Input, Inputs
from winding_ros.runtime.message_handler import Answer, MessageHandler
from winding_ros.runtime.node_trace import NodeTrace
from winding_ros.services import QUICK_STOP, STOP
from winding_ros.topic import Delivered, Topic


class Endpoints:
    """What a managed node publishes and hears from `configure` to `cleanup`.

    Args:
        node: Whose endpoints.
        spec: Its declaration in the graph.
        heartbeat: Is given after each message: a reader in arrears serves many of them before
            the executor's timers run again.
    """

    def __init__(self, node: LifecycleNode, spec: NodeSpec, heartbeat: Heartbeat) -> None:
        self._node = node
        self._spec = spec
        self._heartbeat = heartbeat
        self.trace = NodeTrace(node, spec.name)  # What it notes of the way of a corrected length
        # When the input that is dealt with arrived, by the clock of this system [ns].
        self.arrived_ns = 0
        self._stop_request = StopRequest(node)
        self._publishers: dict[str, Publisher] = {}
        self._subscriptions: list[Subscription] = []
        self._inputs: Inputs | None = None
        self._guards: dict[str, MessageGuard] = {}
        self._rivals: dict[str, Rivals] = {}
        self._mismatch = ""

    def advertise(self, topic: Topic) -> None:
        """Make a publisher that is silent unless the node is active."""
        self._publishers[topic.name] = self._node.create_lifecycle_publisher(
            topic.type,
            topic.name,
            topic.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=PublisherEventCallbacks(
                incompatible_qos=lambda event: self._note_mismatch(topic, "a subscriber", event)
            ),
        )

    def publish(self, topic: Topic, message: Any) -> None:
        """Publish a message, or one in CDR bytes, on a topic that is advertised."""
        data = serialised(message)
        if not self.trace.wanted:
            self._publishers[topic.name].publish(data)
            return
        began = time.time_ns()
        self._publishers[topic.name].publish(data)
        self.trace.published(topic, data, began)

    def matched(self, topic: str) -> int:
        """Return how many subscriptions one of the node's publishers has."""
        return int(self._publishers[topic].get_subscription_count())

    def subscribe(
        self, topic: Topic, callback: Callable[[Any], None], *, raw: bool = False
    ) -> None:
        """Subscribe with a callback that may refuse a message with MessageError.

        A message whose stamp runs backwards, and every message of a topic that has more than
        one publisher, is refused before the callback sees it.
        """
        self._subscriptions.append(
            topic.subscribe(
                self._node,
                self._guarded(topic, callback, raw=raw),
                raw=raw,
                found=self._guard(topic).found,
                events=self._events(topic),
            )
        )

    def listen(self, topic: Topic, callback: Callable[[Any], None]) -> None:
        """Subscribe to what comes from outside the graph; the callback judges it by itself."""
        self._subscriptions.append(
            topic.subscribe(self._node, callback, events=self._events(topic))
        )

    def connect(
        self,
        handler: MessageHandler,
        *,
        extra: Mapping[Topic, Callable[[bytes], None]] | None = None,
        busy: AbstractContextManager[Any] | None = None,
    ) -> None:
        """Publish a handler's answers to each of the node's inputs.

        A node that is triggered deals with everything that has arrived, input by input in the order
        of the graph.

        Args:
            handler: The node's work.
            extra: Take the messages of further topics.
            busy: Held while the handler works, when another thread may call it too.
        """
        answering = {
            topic: self._answering(handler, topic, busy or nullcontext())
            for topic in self._spec.inputs
        }
        self._inputs = Inputs(
            self._node,
            [
                Input(
                    topic=topic,
                    take=self._traced(topic, self._guarded(topic, take, raw=True)),
                    found=self._guard(topic).found,
                    triggers=topic in self._spec.triggers,
                    events=self._events(topic),
                )
                for topic, take in {**answering, **(extra or {})}.items()
            ],
        )

    def look(self) -> None:
        """Deal with everything that has arrived on the node's inputs, from any thread."""
        if self._inputs is not None:
            self._inputs.serve()

    def answer(self, answers: Iterable[Answer]) -> None:
        """Publish answers as they come."""
        for answer in answers:
            if answer.shown is not None:
                self.trace.shown(*answer.shown)
            self.publish(answer.topic, answer.message)

    def admit(self, topic: Topic, t: float, work: Callable[[], None]) -> bool:
        """Deal with a message that was handed over within the process, from any one thread.

        It is judged as if it had come on its topic.

        Args:
            topic: Whose message it is.
            t: Its stamp [s].
            work: Deals with it, and may refuse it with MessageError.

        Returns:
            Whether it was let in.
        """
        guard = self._guard(topic)
        try:
            guard.check(t, self._now, time.monotonic())
            work()
        except (MessageError, StampError) as error:
            self._refuse(guard, t, error)
            return False
        guard.accept()
        return True

    def begin_run(self) -> None:
        """Take the next stamp of every topic as it comes."""
        for guard in self._guards.values():
            guard.restart()

    def clear(self) -> None:
        """Destroy all publishers and subscriptions, and forget what was heard."""
        if self._inputs is not None:
            self._inputs.destroy()
            self._inputs = None
        for publisher in self._publishers.values():
            self._node.destroy_lifecycle_publisher(publisher)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._publishers.clear()
        self._subscriptions.clear()
        self._guards.clear()
        self._rivals.clear()
        self._mismatch = ""

    def rivals(self) -> list[str]:
        """Return one sentence for each of the node's topics that others publish too."""
        return [rivals.sentence for rivals in self._rivals.values() if rivals.sentence]

    def look_for_rivals(self) -> None:
        """Look who publishes on the node's topics now."""
        now = time.monotonic()
        for name in {*self._guards, *self._publishers}:
            before = self._rivals.get(name, Rivals())
            after = before.look(name, contestants(self._node, name), now)
            self._rivals[name] = after
            if name in self._guards:
                self._guards[name].contested = after.sentence
            if after.sentence and after.sentence != before.sentence:
                self._node.get_logger().error(after.sentence)

    def statuses(self) -> list[Status]:
        """Return the statuses of the node's topics."""
        name = self._spec.name
        subscribers = {topic: self.matched(topic) for topic in self._publishers}
        found = [topic_status(name, subscribers, self._guards, self.rivals())]
        if self._mismatch:
            found.append(
                Status(
                    name=f"{name}: quality of service", level=Level.ERROR, message=self._mismatch
                )
            )
        return found

    def restart_queues(self) -> None:
        """Begin to look for the longest queues anew, once the present ones are reported."""
        for guard in self._guards.values():
            guard.restart_queue()

    def _events(self, topic: Topic) -> SubscriptionEventCallbacks:
        return SubscriptionEventCallbacks(
            incompatible_qos=lambda event: self._note_mismatch(topic, "a publisher", event)
        )

    def _guard(self, topic: Topic) -> MessageGuard:
        fresh = MessageGuard(topic.name, steady=topic.rate is not None)
        return self._guards.setdefault(topic.name, fresh)

    def _guarded(
        self, topic: Topic, callback: Callable[[Any], None], *, raw: bool = False
    ) -> Callable[[Any], None]:
        guard = self._guard(topic)

        def guarded(message: Any) -> None:
            stamp = None
            try:
                stamp = _stamp(message, raw=raw)
                guard.check(stamp, self._now, time.monotonic())
                callback(message)
            except (MessageError, StampError) as error:
                self._refuse(guard, stamp, error)
            else:
                guard.accept()
            self._heartbeat.beat()

        return guarded

    def _refuse(self, guard: MessageGuard, stamp: float | None, error: Exception) -> None:
        usable = None if isinstance(error, StampError) else stamp
        guard.refuse(str(error), usable, time.monotonic())
        if guard.alarm:
            self._stop_request.ask(guard.alarm)

    def _traced(self, topic: Topic, take: Callable[[bytes], None]) -> Callable[[Delivered], None]:
        trace = self.trace

        def traced(delivered: Delivered) -> None:
            self.arrived_ns = delivered.arrived_ns
            if not trace.wanted:
                take(delivered.data)
                return
            began = trace.taking()
            take(delivered.data)
            trace.taken(topic, delivered, began)

        return traced

    def _answering(
        self, handler: MessageHandler, topic: Topic, busy: AbstractContextManager[Any]
    ) -> Callable[[bytes], None]:
        def answer(data: bytes) -> None:
            with busy:
                self.answer(handler.take(topic, data))

        return answer

    def _now(self) -> float:
        return float(self._node.get_clock().now().nanoseconds * 1e-9)

    def _note_mismatch(self, topic: Topic, who: str, event: Any) -> None:
        policy = str(event.last_policy_kind).rpartition(".")[2]
        self._mismatch = f"{topic.name}: {who} asks for another quality of service ({policy})"
        self._node.get_logger().error(self._mismatch)


def _stamp(message: Any, *, raw: bool) -> float:
    return serialised_stamp(message) if raw else decode_stamp(message.header.stamp)


def contestants(node: Node, topic: str) -> tuple[Endpoint, ...]:
    """Return the publishers (namespace, node) of a topic that has more than one."""
    if node.count_publishers(topic) < 2:
        return ()
    found = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
    return tuple((publisher.node_namespace, publisher.node_name) for publisher in found)


_REPEAT = 0.5  # An answer can be lost; a machine that stands already stays where it is [s]


class StopRequest:
    """Calls rig/quick_stop, or rig/stop where that has no server, at most every half second."""

    def __init__(self, node: Node, clock: Callable[[], float] = time.monotonic) -> None:
        self._node = node
        self._clock = clock
        self._next = -1.0
        self._ways = tuple((service, service.client(node)) for service in (QUICK_STOP, STOP))

    def ask(self, reason: str) -> None:
        """Ask the machine to come to rest, for a reason."""
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
            f"the machine cannot be asked to stop: no node serves {QUICK_STOP.name} or "
            f"{STOP.name}: {reason}"
        )
