"""Managed (lifecycle) node of the graph: parameters, topics, diagnostics, safe transitions."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Generic, TypeVar

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from winding_core.parameters import ParameterError
from winding_core.status import Level, Status
from winding_ros.diagnostic_messages import encode_diagnostics
from winding_ros.heartbeat import Heartbeat
from winding_ros.message_guard import Endpoint, MessageGuard, Rivals, StampError
from winding_ros.message_handler import Answer, MessageHandler
from winding_ros.node_parameters import (
    declare_parameters,
    read_parameters,
    refuse_invalid,
)
from winding_ros.rig_messages import MessageError
from winding_ros.stamps import decode_stamp, serialised_stamp_ns
from winding_ros.stop_request import StopRequest
from winding_ros.topic_status import news, topic_status
from winding_ros.topics import DIAGNOSTICS, Topic
from winding_ros.wake_up import Queue, in_order

Configuration = TypeVar("Configuration")

# Changes are noticed this often [s]; an unchanged state is repeated at 1 Hz (REP-107).
_WATCH_PERIOD = 0.1
_REPEAT_PERIOD = 1.0


class EndingError(RuntimeError):
    """The process was told to end while the node was at long work."""


class ManagedNode(LifecycleNode, Generic[Configuration]):  # type: ignore[misc]
    """Lifecycle node whose subclasses say what to do in four hooks.

    Subclasses override `configure` (make the core, advertise, subscribe), `activate`,
    `deactivate` and `cleanup`. A refused transition is logged in one sentence and leaves the
    node alive; a refused message is counted and reported in `/diagnostics`.

    Attributes:
        configuration: The node's parameters.
        active: Whether the node works.
        told_to_end: Says whether the process was told to end.
    """

    def __init__(self, name: str, configuration: type[Configuration], **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.configuration: Configuration = declare_parameters(self, configuration)
        self._declared = configuration
        self._configured = False
        self.active = False
        self.told_to_end: Callable[[], bool] = lambda: False
        refuse_invalid(self, configuration, lambda: self._configured)
        self._topic_publishers: dict[str, Publisher] = {}
        self._topic_subscriptions: list[Subscription] = []
        self._intakes: dict[str, MessageGuard] = {}
        self._stop_request = StopRequest(self)
        self._rivals: dict[str, Rivals] = {}
        self._mismatch = ""
        self._failure = ""
        self._fatal: Exception | None = None
        self._diagnostics = DIAGNOSTICS.advertise(self)
        self._heartbeat = Heartbeat(self, name)
        self._last_told: list[Status] = []
        self._silent_periods = 0
        # Wall time: a stopped simulation must still say that it is stopped.
        self._watch = self.create_timer(
            _WATCH_PERIOD, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def configure(self) -> None:
        """Make the core, advertise and subscribe; raise to refuse."""

    def activate(self) -> None:
        """Begin work; raise to refuse."""

    def deactivate(self) -> None:
        """Pause work."""

    def cleanup(self) -> None:
        """Let go of what `configure` made; publishers and subscriptions go by themselves."""

    def come_to_rest(self) -> None:
        """Bring what moves to rest before the process ends; the node still publishes."""

    def contested(self, sentence: str) -> None:
        """Take note that another node publishes on one of this node's topics."""

    def status(self) -> Status:
        """Return the state of the node's own work."""
        return Status(name=self.get_name())

    def go_on(self) -> None:
        """Ask now and then in the long work of a hook whether to go on.

        Raises:
            EndingError: The process was told to end.
        """
        if self.told_to_end():
            raise EndingError("the process was told to end")

    def fail(self, error: Exception) -> None:
        """End the process with an error that happened in a thread of the node's own."""
        self._fatal = error

    def advertise(self, topic: Topic) -> LifecyclePublisher:
        """Return a publisher that is silent unless the node is active."""
        publisher = self.create_lifecycle_publisher(
            topic.type,
            topic.name,
            topic.qos,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=PublisherEventCallbacks(
                incompatible_qos=lambda event: self._note_mismatch(topic, "a subscriber", event)
            ),
        )
        self._topic_publishers[topic.name] = publisher
        return publisher

    def matched(self, topic: str) -> int:
        """Return how many subscriptions one of the node's publishers has."""
        return int(self._topic_publishers[topic].get_subscription_count())

    def subscribe(
        self, topic: Topic, callback: Callable[[Any], None], *, raw: bool = False
    ) -> Subscription:
        """Return a subscription whose callback may refuse a message with MessageError.

        A message whose stamp runs backwards, and every message of a topic that has more than
        one publisher, is refused before the callback sees it.
        """
        subscription = topic.subscribe(
            self,
            self._guarded(topic, callback, raw=raw),
            raw=raw,
            found=self._intake(topic).found,
            events=self._events(topic),
        )
        self._topic_subscriptions.append(subscription)
        return subscription

    def _events(self, topic: Topic) -> SubscriptionEventCallbacks:
        return SubscriptionEventCallbacks(
            incompatible_qos=lambda event: self._note_mismatch(topic, "a publisher", event)
        )

    def _intake(self, topic: Topic) -> MessageGuard:
        return self._intakes.setdefault(topic.name, MessageGuard(topic.name))

    def _guarded(
        self, topic: Topic, callback: Callable[[Any], None], *, raw: bool = False
    ) -> Callable[[Any], None]:
        intake = self._intake(topic)

        def guarded(message: Any) -> None:
            try:
                intake.check(_stamp(message, raw=raw), self._now)
                callback(message)
            except (MessageError, StampError) as error:
                intake.refuse(str(error), time.monotonic())
                if intake.persistent:
                    self._stop_request.ask(f"{topic.name}: {error}")
            else:
                intake.accept()
            # A reader in arrears serves many messages before the executor's timers run again.
            self._heartbeat.beat()

        return guarded

    def connect(
        self, handler: MessageHandler, *, busy: AbstractContextManager[Any] | None = None
    ) -> None:
        """Advertise an handler's outputs, and publish its answers to each of its inputs.

        A node that wakes up deals with everything that has arrived, input by input in the order
        of the handler. An executor serves one topic after the other as they come: a node in
        arrears would see frames of a quarter of a second before the encoder samples of the first
        of them.

        Args:
            handler: The node's work.
            busy: Held while it works, when another thread may call it too.
        """
        for topic in handler.outputs:
            self.advertise(topic)
        subscriptions: dict[Topic, Subscription] = {}
        queues = [
            Queue(
                topic=topic,
                take=self._guarded(topic, self._answering(handler, topic, busy or nullcontext())),
                found=self._intake(topic).found,
            )
            for topic in handler.inputs
        ]
        for topic in handler.inputs:
            woken = in_order(topic, queues, subscriptions)
            subscriptions[topic] = topic.listen(self, woken, events=self._events(topic))
        self._topic_subscriptions += subscriptions.values()

    def publish(self, answers: Iterable[Answer]) -> None:
        """Publish answers as they come."""
        for answer in answers:
            self._topic_publishers[answer.topic.name].publish(answer.message)

    def _answering(
        self, handler: MessageHandler, topic: Topic, busy: AbstractContextManager[Any]
    ) -> Callable[[Any], None]:
        def answer(message: Any) -> None:
            with busy:
                self.publish(handler.take(topic, message))

        return answer

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Make what the node works with: parameters, kernels, state."""
        result = self._transition("configure", self._take_parameters, self.configure)
        self._configured = result is TransitionCallbackReturn.SUCCESS
        if result is TransitionCallbackReturn.FAILURE:
            # What was made before the refusal would be made twice by the next attempt.
            self._clear()
        return result

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Begin to work: subscribe, publish."""
        # Publishers open first, so that `activate` may publish.
        super().on_activate(state)
        for intake in self._intakes.values():
            intake.restart()
        result = self._transition("activate", self.activate)
        self.active = result is TransitionCallbackReturn.SUCCESS
        return result

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Stop to work; keep the configuration."""
        result = self._transition("deactivate", self.deactivate)
        self.active = self.active and result is not TransitionCallbackReturn.SUCCESS
        super().on_deactivate(state)
        return result

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Forget what `on_configure` made."""
        result = self._transition("clean up", self._clear)
        self._configured = result is not TransitionCallbackReturn.SUCCESS
        return result

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """Stop whatever the state is."""
        self.active = False

        def stop() -> None:
            self.deactivate()
            self._clear()

        return self._transition("shut down", stop)

    def on_error(self, state: Any) -> TransitionCallbackReturn:
        """Come back from an error; the sentence is in /diagnostics."""
        return TransitionCallbackReturn.FAILURE

    def destroy_node(self) -> None:
        """Stop work and release everything."""
        self.deactivate()
        self._clear()
        super().destroy_node()

    def _clear(self) -> None:
        self.cleanup()
        for publisher in self._topic_publishers.values():
            self.destroy_lifecycle_publisher(publisher)
        for subscription in self._topic_subscriptions:
            self.destroy_subscription(subscription)
        self._topic_publishers.clear()
        self._topic_subscriptions.clear()
        self._intakes.clear()
        self._rivals.clear()
        self._mismatch = ""

    def _take_parameters(self) -> None:
        self.configuration = read_parameters(self, self._declared)

    def _transition(self, name: str, *hooks: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            for hook in hooks:
                hook()
        except (ParameterError, ValueError, FileNotFoundError, EndingError) as error:
            self._failure = f"cannot {name}: {error}"
            self.get_logger().error(self._failure)
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # noqa: BLE001 - rclpy would hide the cause
            self._failure = f"cannot {name}: {type(error).__name__}: {error}"
            self.get_logger().error(f"{self._failure}\n{traceback.format_exc()}")
            return TransitionCallbackReturn.ERROR
        self._failure = ""
        return TransitionCallbackReturn.SUCCESS

    def _LifecycleNodeMixin__on_change_state(self, request: Any, response: Any) -> Any:  # noqa: N802
        # rclpy 7.1 lets an invalid transition request escape spin() and kill the node; its
        # error type is private, and this private method is the only place to catch it.
        try:
            return super()._LifecycleNodeMixin__on_change_state(request, response)
        except Exception as error:  # noqa: BLE001
            self.get_logger().warning(
                f"refused transition {request.transition.id} {request.transition.label!r}: {error}"
            )
            response.success = False
            return response

    def _tell(self) -> None:
        if self._fatal is not None:
            raise self._fatal
        self._heartbeat.beat()
        self._look_for_rivals()
        statuses = self._statuses()
        self._silent_periods += 1
        changed = news(statuses) != news(self._last_told)
        if changed or self._silent_periods * _WATCH_PERIOD >= _REPEAT_PERIOD:
            self._diagnostics.publish(
                encode_diagnostics(
                    self.get_clock().now().nanoseconds * 1e-9,
                    statuses,
                    hardware_id=self.get_namespace(),
                )
            )
            self._last_told = statuses
            self._silent_periods = 0
            for intake in self._intakes.values():
                intake.told()

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def rivals(self) -> list[str]:
        """Return one sentence for each of the node's topics that others publish too."""
        return [rivals.sentence for rivals in self._rivals.values() if rivals.sentence]

    def _note_mismatch(self, topic: Topic, who: str, event: Any) -> None:
        policy = str(event.last_policy_kind).rpartition(".")[2]
        self._mismatch = f"{topic.name}: {who} asks for another quality of service ({policy})"
        self.get_logger().error(self._mismatch)

    def _look_for_rivals(self) -> None:
        now = time.monotonic()
        for name in {*self._intakes, *self._topic_publishers}:
            publishers: tuple[Endpoint, ...] = ()
            if self.count_publishers(name) > 1:
                publishers = tuple(
                    (found.node_namespace, found.node_name)
                    for found in self.get_publishers_info_by_topic(self.resolve_topic_name(name))
                )
            before = self._rivals.get(name, Rivals())
            after = self._rivals[name] = before.look(name, publishers, now)
            if name in self._intakes:
                self._intakes[name].contested = after.sentence
            if after.sentence and after.sentence != before.sentence:
                self.get_logger().error(after.sentence)
            if after.sentence:
                self.contested(after.sentence)

    def _statuses(self) -> list[Status]:
        own = self.status()
        if self._failure:
            own = Status(name=own.name, level=Level.ERROR, message=self._failure, values=own.values)
        subscribers = {name: self.matched(name) for name in self._topic_publishers}
        return [
            own,
            topic_status(self.get_name(), subscribers, self._intakes, self.rivals()),
            *self._mismatches(),
        ]

    def _mismatches(self) -> list[Status]:
        if not self._mismatch:
            return []
        return [
            Status(
                name=f"{self.get_name()}: quality of service",
                level=Level.ERROR,
                message=self._mismatch,
            )
        ]


def _stamp(message: Any, *, raw: bool) -> float:
    return serialised_stamp_ns(message) * 1e-9 if raw else decode_stamp(message.header.stamp)
