"""Service calls that asyncio can await, through a node that another thread spins."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

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
        """Return whether somebody serves a service."""
        return bool(self._client(service, name).service_is_ready())

    async def call(
        self, service: type, name: str, request: Any, timeout: float, *, retry: bool = True
    ) -> Any:
        """Return a service's response.

        Raises:
            TimeoutError: No response within timeout [s].
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
        # The last answers may come when nobody waits any more.
        if not loop.is_closed():
            loop.call_soon_threadsafe(settle, done)

    future.add_done_callback(hand_over)
    return result
