"""Runs of an external machine, one after the other as its operator conducts it.

Service orchestrator/next_run: an operator reports that the machine stands ready for another run.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Coroutine
from typing import Any

from winding_core.status import COMPONENT, Level, RunPhase
from winding_ros import services
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import GraphError
from winding_supervisor.machines.external_machine import ExternalMachine
from winding_supervisor.processes.orchestrator import Orchestrator
from winding_supervisor.session.machine_run import MachineRun, View
from winding_supervisor.session.rest import Rest
from winding_supervisor.session.run_result import RunResult
from winding_supervisor.watch.supervisor import Supervisor

_REPORT_PERIOD, _POLL = 1.0, 0.05
_TAKEN = "machine and nodes are made ready for the next run"


class NextRun:
    """Reports the phase of the present run, and takes requests for the next one.

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
        self._report()

    def remark(self, sentence: str) -> None:
        """Report a remark on the machine beside the phase of its run."""
        self._reason = sentence
        self._report()

    @property
    def is_asked(self) -> bool:
        """Whether another run is wanted."""
        return self._asked.is_set()

    async def asked(self) -> None:
        """Wait until another run is wanted."""
        await self._asked.wait()

    async def keep_reporting(self) -> None:
        """Report the phase of the run in the diagnostics, again and again."""
        while True:
            self._report()
            await asyncio.sleep(_REPORT_PERIOD)

    def _report(self) -> None:
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


Parameters = dict[str, dict[str, object]]


class ExternalSession:
    """Follows run after run until the operator ends the session.

    A run is over when the machine has come to its end or has stood for long enough; the machine
    is then brought to rest and may be moved by hand. The next one begins at the place where the
    machine stands when the operator asks for it (orchestrator/next_run).

    Args:
        machine: Stands where the first run begins.
        orchestrator: Makes the nodes ready for the next run.
        supervisor: Watches while a run is under way.
        next_run: Takes the operator's wish.
        ended: Is set when the operator ends the session.
        parameters: Returns the parameters of every node that reads axes, by node.
        rest: Stays at a machine that does not stop.
    """

    def __init__(
        self,
        machine: ExternalMachine,
        orchestrator: Orchestrator,
        supervisor: Supervisor,
        next_run: NextRun,
        ended: asyncio.Event,
        parameters: Callable[[], Parameters],
        rest: Rest,
    ) -> None:
        self._machine, self._orchestrator, self._rest = machine, orchestrator, rest
        self._supervisor, self._next_run = supervisor, next_run
        self._ended, self._parameters = ended, parameters

    async def follow(
        self,
        new_run: Callable[[], MachineRun],
        view: View,
        take: Callable[[], Coroutine[Any, Any, RunResult | None]],
        deliver: Callable[[RunResult], Coroutine[Any, Any, None]],
        work: Coroutine[Any, Any, None],
    ) -> None:
        """Return when the operator has ended the session.

        Args:
            new_run: Returns what follows the run that begins now.
            view: Called a few times per second while a run is waited for or under way.
            take: Brings the machine to rest and returns what the run leaves; None where none has
                begun.
            deliver: Hands it over.
            work: What must go on meanwhile; when it fails, so does this.
        """
        working = asyncio.create_task(work)
        reporting = asyncio.create_task(self._next_run.keep_reporting())
        try:
            while not self._ended.is_set():
                beside = (self._supervisor.watch(), self._note_begin(), _as_long_as(working))
                await new_run().follow(view, self._cut, beside, self._next_run.remark)
                if self._ended.is_set():
                    return
                result = await take()
                self._next_run.enter(RunPhase.OVER)
                if result is not None:
                    await deliver(result)
                staying = asyncio.create_task(self._rest.hold(math.inf))
                try:
                    await self._until_ready(working)
                finally:
                    staying.cancel()
        except (GraphError, TimeoutError):
            self._next_run.enter(RunPhase.FAILED)
            raise
        finally:
            working.cancel()
            reporting.cancel()

    def _cut(self) -> bool:
        return self._ended.is_set() or self._next_run.is_asked

    async def _note_begin(self) -> None:
        while self._machine.began is None:
            await asyncio.sleep(_POLL)
        self._next_run.enter(RunPhase.UNDER_WAY)

    async def _until_ready(self, working: asyncio.Task[None]) -> None:
        """Wait until the machine and all nodes are ready for another run, or the session ends."""
        preparing = asyncio.create_task(self._prepare())
        ending = asyncio.create_task(self._ended.wait())
        try:
            await asyncio.wait([preparing, ending, working], return_when=asyncio.FIRST_COMPLETED)
            for task in (working, preparing):
                if task.done():
                    task.result()
        finally:
            preparing.cancel()
            ending.cancel()

    async def _prepare(self) -> None:
        """Make machine and nodes ready when the operator asks, again and again until they are."""
        while True:
            await self._next_run.asked()
            self._next_run.enter(RunPhase.PREPARED)
            try:
                await self._machine.reset()
                await self._machine.stand()
                await self._orchestrator.bring_up_anew(self._parameters())
                await self._machine.ready()
            except (GraphError, TimeoutError) as error:
                self._next_run.enter(RunPhase.OVER, f"no next run: {error}")
            else:
                self._next_run.enter(RunPhase.READY)
                return


async def _as_long_as(task: asyncio.Task[None]) -> None:
    await asyncio.shield(task)
