"""The orchestrator's own node, spun in a thread, with service calls that asyncio can await."""

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from winding_core.status import Level, Status
from winding_ros import topics
from winding_ros.environment import enclave_arguments, ros_arguments
from winding_ros.message_guard import subscribers_of
from winding_ros.messages.diagnostics import decode_diagnostics, encode_diagnostics
from winding_ros.runtime.heartbeat import Heartbeat, Sign, heartbeat_topic, watch_heartbeat

# A request sent before the server is matched is lost, so requests are repeated.
_RETRY_PERIOD = 0.5
_POLL = 0.02


class ServiceCaller:
    """Calls services and keeps their clients.

    Args:
        node: A node that an executor spins in a thread of its own.
        wake: Tells the executor that the node has further clients.
    """

    def __init__(self, node: Node, wake: Callable[[], None]) -> None:
        self.node = node
        self._wake = wake
        self._clients: dict[str, Any] = {}

    def ready(self, service: type, name: str) -> bool:
        """Return whether a service has a server."""
        return bool(self._client(service, name).service_is_ready())

    async def call(
        self, service: type, name: str, request: Any, timeout: float | None, *, retry: bool = True
    ) -> Any:
        """Return a service's response.

        Raises:
            TimeoutError: No response within timeout [s]; None waits without limit.
        """
        client = self._client(service, name)
        asked: dict[asyncio.Future[Any], Any] = {}
        try:
            async with asyncio.timeout(timeout):
                while not client.service_is_ready():
                    await asyncio.sleep(_POLL)
                while True:
                    pending = client.call_async(request)
                    asked[_awaitable(pending)] = pending
                    # A busy server may answer the first request after the second was sent.
                    answered, _ = await asyncio.wait(
                        asked,
                        timeout=_RETRY_PERIOD if retry else None,
                        return_when=asyncio.FIRST_COMPLETED,
                    )
                    if answered:
                        return answered.pop().result()
        except TimeoutError:
            raise TimeoutError(f"no answer from {client.srv_name} in {timeout:g} s") from None
        finally:
            for pending in asked.values():
                client.remove_pending_request(pending)

    async def try_call(self, service: type, name: str, request: Any, timeout: float) -> Any | None:
        """Return a service's response, or None when there is none within timeout [s]."""
        try:
            return await self.call(service, name, request, timeout, retry=False)
        except TimeoutError:
            return None

    def _client(self, service: type, name: str) -> Any:
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service, name)
            self._wake()
        return self._clients[name]


def _awaitable(future: Any) -> asyncio.Future[Any]:
    """Return a future of the running event loop that follows one of rclpy."""
    loop = asyncio.get_running_loop()
    result: asyncio.Future[Any] = loop.create_future()

    def settle(done: Any) -> None:
        if not result.done():
            result.set_result(done.result())

    def hand_over(done: Any) -> None:
        # The last answers may come after the loop was closed.
        if not loop.is_closed():
            loop.call_soon_threadsafe(settle, done)

    future.add_done_callback(hand_over)
    return result


_SPIN_PERIOD = 0.1
NAME = topics.ORCHESTRATOR


class AsyncClient(ServiceCaller):
    """Node `orchestrator`: calls services, keeps the latest status of every node."""

    def __init__(self, namespace: str) -> None:
        self._context = Context()
        rclpy.init(
            # Its log goes to stderr; a file of rcl's has no bound.
            args=[
                NAME,
                *enclave_arguments(namespace, NAME),
                "--ros-args",
                "--disable-external-lib-logs",
            ],
            context=self._context,
            signal_handler_options=rclpy.SignalHandlerOptions.NO,
        )
        node = Node(NAME, context=self._context, cli_args=ros_arguments(namespace))
        self._executor = EventsExecutor(context=self._context)
        super().__init__(node, self._executor.wake)
        self._hardware_id = f"/{namespace}"
        self._statuses: dict[str, Status] = {}
        topics.DIAGNOSTICS.subscribe(self.node, self._note)
        self._diagnostics = topics.DIAGNOSTICS.advertise(self.node)
        self._heartbeat = Heartbeat(self.node, NAME, watched=False)
        self._executor.add_node(self.node)
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._spin, name="orchestrator")

    def start(self) -> None:
        """Begin to spin."""
        self._thread.start()

    def close(self) -> None:
        """Stop spinning and leave the graph."""
        self._quit.set()
        if self._thread.is_alive():
            self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def status(self, name: str) -> Status | None:
        """Return the last status of that name, such as `winding_rig` or `winding_rig: topics`."""
        return self._statuses.get(name)

    def beat(self) -> None:
        """Publish a sign of life; nodes that move something stop when it falls silent."""
        self._heartbeat.beat()

    def watch(self, name: str, notify: Callable[[Sign], None]) -> None:
        """Report a node's signs of life, and their end, in the event loop that runs now."""
        loop = asyncio.get_running_loop()

        def hand_over(sign: Sign) -> None:
            # The last signs of life may come after the loop was closed.
            if not loop.is_closed():
                loop.call_soon_threadsafe(notify, sign)

        watch_heartbeat(self.node, name, hand_over)
        self._executor.wake()

    def present(self, name: str) -> int:
        """Return how many processes of a node the graph knows, those lately killed included."""
        return int(self.node.count_publishers(heartbeat_topic(name)))

    def report(
        self, t: float, level: Level, name: str, message: str, values: dict[str, str]
    ) -> None:
        """Publish a status of the orchestrator's own, at simulated time t [s]."""
        status = Status(name=f"{NAME}: {name}", level=level, message=message, values=values)
        self._diagnostics.publish(encode_diagnostics(t, [status], hardware_id=self._hardware_id))

    def matched(self, node: str, topic: str) -> int:
        """Return how many subscriptions a node's publisher reports."""
        status = self._statuses.get(f"{node}: topics")
        return subscribers_of(status.values).get(topic, 0) if status else 0

    def _note(self, message: Any) -> None:
        if any(status.hardware_id == self._hardware_id for status in message.status):
            _, statuses = decode_diagnostics(message)
            self._statuses |= {status.name: status for status in statuses}

    def _spin(self) -> None:
        while not self._quit.is_set():
            self._executor.spin_once(timeout_sec=_SPIN_PERIOD)
