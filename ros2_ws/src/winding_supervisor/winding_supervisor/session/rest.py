"""Bring the machine to rest when a run is over, and stay at it until it is seen standing."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from winding_core.run_outcome import Motion
from winding_core.status import MACHINE_COMPONENT, Level
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_supervisor.machines.machine import Machine
from winding_supervisor.watch.event_log import EventLog

_POLL = 0.05
# A machine that was asked to stop has so long to stand [s].
_STAND_TIMEOUT = 3.0
# So often it is asked again, and so often the terminal is reminded [s].
_AGAIN, _REMINDER = 2.0, 10.0
_AT_RISK = (Motion.TURNING, Motion.UNKNOWN)


class Rest:
    """Ends the motion of a machine.

    Args:
        machine: Which.
        log: Takes each stop and how it failed.
        client: Publishes the state of a machine that may still move, for the operator's page.
        report: Takes sentences for the terminal.

    Attributes:
        motion: What was last known of the machine.
        confirmed: Set when an operator confirms that the machine stands.
    """

    def __init__(
        self,
        machine: Machine,
        log: EventLog,
        client: AsyncClient,
        report: Callable[[str], None],
    ) -> None:
        self._machine, self._log, self._client, self._report = machine, log, client, report
        self.motion = Motion.STANDING
        self.confirmed = asyncio.Event()

    async def bring(self) -> str:
        """Leave the machine at rest; return why it may still move, or nothing."""
        self.confirmed.clear()
        failure = await self._machine.leave()
        if failure is None:
            self.motion = self._machine.motion
            if self.motion is Motion.UNKNOWN and not self._log.stops:
                # Nothing has moved it in this run.
                self.motion = Motion.STANDING
        else:
            self._note(failure)
            self.motion = await self._stood() if not failure else self._machine.motion
        return self.danger

    @property
    def danger(self) -> str:
        """Why the machine may still move, or nothing."""
        return self._log.ending(self.motion).danger

    async def hold(self, patience: float) -> None:
        """Ask again and again until the machine is seen standing, or an operator confirms it.

        Args:
            patience: To be given up after so long where no operator is present [s].
        """
        begin = time.monotonic()
        asked = reminded = begin - _REMINDER
        while self.motion in _AT_RISK and not self.confirmed.is_set():
            now = time.monotonic()
            if now - begin > patience:
                return
            if now - reminded >= _REMINDER:
                self._report(f"{self.danger}; stop it at the machine")
                reminded = now
            if now - asked >= _AGAIN:
                self._tell(Level.ERROR, self.danger)
                self._note(await self._machine.quick_stop())
                asked = time.monotonic()
            await asyncio.sleep(_POLL)
            self.motion = self._machine.motion
        if self.motion is Motion.STANDING:
            self._log.note("standing", topics.RIG, "both axes stand", t=self._machine.t)
            self._report("the machine stands")
        self._tell(Level.OK, "")

    def _note(self, failure: str) -> None:
        self._log.stop(self._machine.t, "session", failure)
        if failure:
            self._log.note("not stopped", topics.RIG, failure, t=self._machine.t)

    async def _stood(self) -> Motion:
        end = time.monotonic() + _STAND_TIMEOUT
        while self._machine.motion is not Motion.STANDING and time.monotonic() < end:
            await asyncio.sleep(_POLL)
        return self._machine.motion

    def _tell(self, level: Level, message: str) -> None:
        self._client.tell(self._machine.t, level, MACHINE_COMPONENT, message, {})
