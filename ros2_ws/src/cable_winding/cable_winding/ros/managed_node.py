"""Managed (lifecycle) node of the graph: parameters, topics, diagnostics, safe transitions."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from cable_winding.parameters import ParameterError
from cable_winding.ros.diagnostic_messages import Level, Status, encode_diagnostics
from cable_winding.ros.parameters import declare_parameters, refuse_invalid
from cable_winding.ros.rig_messages import MessageError
from cable_winding.ros.topics import DIAGNOSTICS, Topic

Configuration = TypeVar("Configuration")

# Changes are noticed this often [s]; an unchanged state is repeated at 1 Hz (REP-107).
_WATCH_PERIOD = 0.1
_REPEAT_PERIOD = 1.0
MATCHED = "matched "


class ManagedNode(LifecycleNode, Generic[Configuration]):  # type: ignore[misc]
    """Lifecycle node whose subclasses say what to do in four hooks.

    Subclasses override `configure` (make the core, advertise, subscribe), `activate`,
    `deactivate` and `cleanup`. A refused transition is logged in one sentence and leaves the
    node alive; a refused message is counted and reported in `/diagnostics`.

    Attributes:
        configuration: The node's parameters.
    """

    def __init__(self, name: str, configuration: type[Configuration], **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.configuration: Configuration = declare_parameters(self, configuration)
        refuse_invalid(self, configuration)
        self._topic_publishers: dict[str, Publisher] = {}
        self._topic_subscriptions: list[Subscription] = []
        self._refused: Counter[str] = Counter()
        self._refusal = ""
        self._failure = ""
        self._fatal: Exception | None = None
        self._diagnostics = DIAGNOSTICS.advertise(self)
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

    def status(self) -> Status:
        """Return the state of the node's own work."""
        return Status(name=self.get_name())

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
        )
        self._topic_publishers[topic.name] = publisher
        return publisher

    def matched(self, topic: str) -> int:
        """Return how many subscriptions one of the node's publishers has."""
        return int(self._topic_publishers[topic].get_subscription_count())

    def subscribe(
        self, topic: Topic, callback: Callable[[Any], None], *, raw: bool = False
    ) -> Subscription:
        """Return a subscription whose callback may refuse a message with MessageError."""

        def guarded(message: Any) -> None:
            try:
                callback(message)
            except MessageError as error:
                self._refused[topic.name] += 1
                self._refusal = f"refused a message on {topic.name}: {error}"

        subscription = topic.subscribe(self, guarded, raw=raw)
        self._topic_subscriptions.append(subscription)
        return subscription

    def on_configure(self, state: Any) -> TransitionCallbackReturn:  # noqa: D102
        return self._transition("configure", self.configure)

    def on_activate(self, state: Any) -> TransitionCallbackReturn:  # noqa: D102
        # Publishers open first, so that `activate` may publish.
        super().on_activate(state)
        return self._transition("activate", self.activate)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:  # noqa: D102
        result = self._transition("deactivate", self.deactivate)
        super().on_deactivate(state)
        return result

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:  # noqa: D102
        return self._transition("clean up", self._clear)

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:  # noqa: D102
        def stop() -> None:
            self.deactivate()
            self._clear()

        return self._transition("shut down", stop)

    def on_error(self, state: Any) -> TransitionCallbackReturn:  # noqa: D102
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

    def _transition(self, name: str, hook: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            hook()
        except (ParameterError, ValueError, FileNotFoundError) as error:
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
        statuses = self._statuses()
        self._silent_periods += 1
        changed = [(s.name, s.level, s.message) for s in statuses] != [
            (s.name, s.level, s.message) for s in self._last_told
        ] or _matches(statuses) != _matches(self._last_told)
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

    def _statuses(self) -> list[Status]:
        own = self.status()
        if self._failure:
            own = Status(name=own.name, level=Level.ERROR, message=self._failure, values=own.values)
        values = {f"{MATCHED}{name}": str(self.matched(name)) for name in self._topic_publishers}
        values |= {f"refused {name}": str(count) for name, count in self._refused.items()}
        return [
            own,
            Status(
                name=f"{self.get_name()}: topics",
                level=Level.WARN if self._refused else Level.OK,
                message=self._refusal,
                values=values,
            ),
        ]


def _matches(statuses: Sequence[Status]) -> list[tuple[str, str]]:
    return [
        item for status in statuses for item in status.values.items() if item[0].startswith(MATCHED)
    ]
