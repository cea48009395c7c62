"""Bring the machine to rest when a run is over, and stay at it until it is seen standing."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass

from winding_core.run_outcome import Motion
from winding_core.status import MACHINE_COMPONENT, Level
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_supervisor.machines.machine import Machine
from winding_supervisor.watch.event_log import EventLog

_POLL = 0.05
_STAND_TIMEOUT = 3.0  # A machine that was asked to stop has so long to stand [s]
# So often it is asked again, and so often the terminal is reminded [s].
_AGAIN, _REMINDER = 2.0, 10.0
_AT_RISK = (Motion.TURNING, Motion.UNKNOWN)


@dataclass(eq=False)
class Rest:
    """Ends the motion of a machine.

    Attributes:
        motion: What was last known of the machine.
        confirmed: Set when an operator confirms that the machine stands.
    """

    machine: Machine  # Which
    log: EventLog  # Takes each stop and how it failed
    # Publishes the state of a machine that may still move, for the operator's page
    client: AsyncClient
    report: Callable[[str], None]  # Takes sentences for the terminal

    def __post_init__(self) -> None:
        self.motion = Motion.STANDING
        self.confirmed = asyncio.Event()

    async def bring(self) -> str:
        """Leave the machine at rest; return why it may still move, or nothing."""
        self.confirmed.clear()
        failure = await self.machine.leave()
        if failure is None:
            self.motion = self.machine.motion
            if self.motion is Motion.UNKNOWN and not self.log.stops:
                # Nothing has moved it in this run.
                self.motion = Motion.STANDING
        else:
            self._note(failure)
            self.motion = await self._stood() if not failure else self.machine.motion
        return self.danger

    @property
    def danger(self) -> str:
        """Why the machine may still move, or nothing."""
        return self.log.ending(self.motion).danger

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
                self.report(f"{self.danger}; stop it at the machine")
                reminded = now
            if now - asked >= _AGAIN:
                self._publish(Level.ERROR, self.danger)
                self._note(await self.machine.quick_stop())
                asked = time.monotonic()
            await asyncio.sleep(_POLL)
            self.motion = self.machine.motion
        if self.motion is Motion.STANDING:
            self.log.note("standing", topics.RIG, "both axes stand", t=self.machine.t)
            self.report("the machine stands")
        self._publish(Level.OK, "")

    def _note(self, failure: str) -> None:
        self.log.stop(self.machine.t, "session", failure)
        if failure:
            self.log.note("not stopped", topics.RIG, failure, t=self.machine.t)

    async def _stood(self) -> Motion:
        end = time.monotonic() + _STAND_TIMEOUT
        while self.machine.motion is not Motion.STANDING and time.monotonic() < end:
            await asyncio.sleep(_POLL)
        return self.machine.motion

    def _publish(self, level: Level, message: str) -> None:
        self.client.report(self.machine.t, level, MACHINE_COMPONENT, message, {})
