"""Managed (lifecycle) node of the graph: parameters, topics, diagnostics, safe transitions."""

import traceback
from collections.abc import Callable, Iterable
from typing import Any, Generic, TypeVar

from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

from winding_core.compile_progress import COMPILING, PROGRESS, Compiling
from winding_core.parameters import ParameterError
from winding_core.status import REFUSED_TRANSITION, Level, Status
from winding_ros.graph import NodeSpec
from winding_ros.message_guard import news
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.runtime.endpoints import Endpoints
from winding_ros.runtime.heartbeat import Heartbeat
from winding_ros.runtime.message_handler import Answer
from winding_ros.runtime.node_parameters import (
    DECLARED_FROM_OVERRIDES,
    add_parameter_validation,
    declare_parameters,
    read_parameters,
)
from winding_ros.topic import Topic
from winding_ros.topics import DIAGNOSTICS

Configuration = TypeVar("Configuration")

# Changes are noticed this often [s]; an unchanged state is repeated at 1 Hz (REP-107).
_WATCH_PERIOD = 0.1
_REPEAT_PERIOD = 1.0


class EndingError(RuntimeError):
    """The process was asked to stop while the node was at long work."""


class ManagedNode(LifecycleNode, Generic[Configuration]):  # type: ignore[misc]
    """Lifecycle node whose subclasses implement four hooks.

    Subclasses override `configure` (make the core, subscribe), `activate`, `deactivate` and
    `cleanup`; the topics that the graph declares for them are advertised before `configure`. A
    refused transition is logged in one sentence and leaves the node alive; a refused message is
    counted and reported in `/diagnostics`.
    """

    def __init__(self, spec: NodeSpec, configuration: type[Configuration], **kwargs: Any) -> None:
        super().__init__(spec.name, **DECLARED_FROM_OVERRIDES, **kwargs)
        self._survive_invalid_transitions()
        self._spec = spec
        # The node's parameters.
        self.configuration: Configuration = declare_parameters(self, configuration)
        self._declared = configuration
        self._configured = False
        self.active = False  # Whether the node works
        # Returns whether the process was asked to stop.
        self.stop_requested: Callable[[], bool] = lambda: False
        add_parameter_validation(self, configuration, lambda: self._configured)
        self._failure = self._refused = ""
        self._fatal: Exception | None = None
        self._diagnostics = DIAGNOSTICS.advertise(self)
        self._heartbeat = Heartbeat(self, spec.name)
        self.endpoints = Endpoints(self, spec, self._heartbeat)  # Its publishers and subscriptions
        self._last_published: list[Status] = []
        self._silent_periods = 0
        # Wall time: a stopped simulation must still report that it is stopped.
        self._watch = self.create_timer(
            _WATCH_PERIOD, self._publish_diagnostics, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def configure(self) -> None:
        """Make the core and subscribe; raise to refuse."""

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

    def advertised(self) -> Iterable[Topic]:
        """Return what the node publishes; by default what the graph declares."""
        return self._spec.publishes

    def status(self) -> Status:
        """Return the state of the node's own work."""
        return Status(name=self.get_name())

    def go_on(self) -> None:
        """Ask now and then in the long work of a hook whether to go on.

        Raises:
            EndingError: The process was asked to stop.
        """
        if self.stop_requested():
            raise EndingError("the process was asked to stop")

    def fail(self, error: Exception) -> None:
        """End the process with an error that happened in a thread of the node's own."""
        self._fatal = error

    def matched(self, topic: str) -> int:
        """Return how many subscriptions one of the node's publishers has."""
        return self.endpoints.matched(topic)

    def publish(self, answers: Iterable[Answer]) -> None:
        """Publish answers as they come."""
        self.endpoints.answer(answers)

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Make what the node works with: parameters, kernels, state."""
        result = self._transition(
            "configure", self._take_parameters, self._advertise, self.configure
        )
        self._configured = result is TransitionCallbackReturn.SUCCESS
        if result is TransitionCallbackReturn.FAILURE:
            # What was made before the refusal would be made twice by the next attempt.
            self._clear()
        return result

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Begin to work: subscribe, publish."""
        # Publishers open first, so that `activate` may publish.
        super().on_activate(state)
        self.endpoints.begin_run()
        result = self._transition("activate", self.activate)
        self.active = result is TransitionCallbackReturn.SUCCESS
        return result

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Stop to work; keep the configuration."""
        result = self._transition("deactivate", self.deactivate)
        self.active = self.active and result is not TransitionCallbackReturn.SUCCESS
        # Its process may end before the next look.
        self.endpoints.trace.publish()
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
        self.endpoints.clear()

    def _advertise(self) -> None:
        for topic in self.advertised():
            self.endpoints.advertise(topic)

    def _take_parameters(self) -> None:
        self.configuration = read_parameters(self, self._declared)

    def _transition(self, name: str, *hooks: Callable[[], None]) -> TransitionCallbackReturn:
        self._refused = name
        try:
            with PROGRESS.heard(self._report_compiling):
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

    def _report_compiling(self, kernel: Compiling | None) -> None:
        """Report what keeps the node from answering."""
        if kernel is None:
            return
        self.get_logger().info(kernel.sentence)
        values = {COMPILING: kernel.share}
        status = Status(name=self.get_name(), message=kernel.sentence, values=values)
        self._publish_statuses([status])

    def _publish_statuses(self, statuses: list[Status]) -> None:
        stamp = self.get_clock().now().nanoseconds * 1e-9
        self._diagnostics.publish(
            encode_diagnostics(stamp, statuses, hardware_id=self.get_namespace())
        )

    def _survive_invalid_transitions(self) -> None:
        """Refuse them: rclpy 7.1 lets their error, of a private type, escape spin()."""
        (service,) = (each for each in self.services if each.srv_type is ChangeState)
        change = service.callback

        def answer(request: ChangeState.Request, response: ChangeState.Response) -> Any:
            try:
                return change(request, response)
            except Exception as error:  # noqa: BLE001
                wanted = request.transition
                self.get_logger().warning(
                    f"refused transition {wanted.id} {wanted.label!r}: {error}"
                )
                response.success = False
                return response

        service.callback = answer

    def _publish_diagnostics(self) -> None:
        if self._fatal is not None:
            raise self._fatal
        self._heartbeat.beat()
        self.endpoints.trace.publish()
        self.endpoints.look_for_rivals()
        for sentence in self.endpoints.rivals():
            self.contested(sentence)
        statuses = self._statuses()
        self._silent_periods += 1
        changed = news(statuses) != news(self._last_published)
        if changed or self._silent_periods * _WATCH_PERIOD >= _REPEAT_PERIOD:
            self._publish_statuses(statuses)
            self._last_published = statuses
            self._silent_periods = 0
            self.endpoints.restart_queues()

    def _statuses(self) -> list[Status]:
        own = self.status()
        if self._failure:
            values = {**own.values, REFUSED_TRANSITION: self._refused}
            own = Status(name=own.name, level=Level.ERROR, message=self._failure, values=values)
        return [own, *self.endpoints.statuses()]
