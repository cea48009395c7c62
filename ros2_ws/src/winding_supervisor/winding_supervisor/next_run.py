"""Service orchestrator/next_run: an operator says that the machine stands ready for another run."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from winding_core.status import COMPONENT, Level, RunPhase
from winding_ros import services
from winding_ros.client.async_client import AsyncClient

_PERIOD = 1.0
_TAKEN = "machine and nodes are made ready for the next run"


class NextRun:
    """Says how far the present run is, and takes requests for the next one.

    Args:
        client: The orchestrator's node.
        time_of: Returns the machine's time [s].
        standing: Returns whether the machine stands.
    """

    def __init__(
        self, client: AsyncClient, time_of: Callable[[], float], standing: Callable[[], bool]
    ) -> None:
        self._client, self._time_of, self._standing = client, time_of, standing
        self._phase, self._reason = RunPhase.READY, ""
        self._loop = asyncio.get_running_loop()
        self._asked = asyncio.Event()
        services.NEXT_RUN.serve(client.node, self._answer)

    def enter(self, phase: RunPhase, reason: str = "") -> None:
        """Begin a phase of the run, for a reason that the operator should know."""
        if phase is RunPhase.PREPARED:
            self._asked.clear()
        self._phase, self._reason = phase, reason
        self._say()

    @property
    def is_asked(self) -> bool:
        """Whether another run is wanted."""
        return self._asked.is_set()

    async def asked(self) -> None:
        """Wait until another run is wanted."""
        await self._asked.wait()

    async def keep_saying(self) -> None:
        """Say in the diagnostics how far the run is, again and again."""
        while True:
            self._say()
            await asyncio.sleep(_PERIOD)

    def _say(self) -> None:
        level = Level.WARN if self._reason else Level.OK
        message = self._reason or f"the run is {self._phase.value}"
        values = {"phase": self._phase.value}
        self._client.tell(self._time_of(), level, COMPONENT, message, values)

    def _answer(self, _request: Any, response: Any) -> Any:
        """Answer in the thread that spins the node."""
        refusal = self._refusal()
        response.success, response.message = not refusal, refusal or _TAKEN
        if not refusal:
            self._loop.call_soon_threadsafe(self._asked.set)
        return response

    def _refusal(self) -> str:
        if self._phase is RunPhase.FAILED:
            return "the session cannot go on"
        if self._phase is RunPhase.PREPARED:
            return "the next run is being prepared"
        if self._phase is RunPhase.UNDER_WAY and not self._standing():
            return "a run is under way; stop the machine first"
        return ""
