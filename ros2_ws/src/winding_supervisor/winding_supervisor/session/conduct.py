"""How runs begin and who wants the next one: this process, or the operator of a driver's machine.

Service orchestrator/next_run: an operator reports that the machine stands ready for another run.
"""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from winding_core.run_outcome import Cause, EndedBy
from winding_core.status import COMPONENT, Level, RunPhase
from winding_ros import services
from winding_ros.graph import GraphError
from winding_supervisor.machines.external_machine import ExternalMachine
from winding_supervisor.session.participants import Participants

_REPORT_PERIOD = 1.0
_TAKEN = "machine and nodes are made ready for the next run"

Parameters = dict[str, dict[str, object]]


class Conduct:
    """One run, which is started here.

    Attributes:
        operated: Whether an operator begins runs, as many as they like.
        throughout: Whether nodes and machine are watched between two runs as well.
        anew: When the next run has begun although this one was not over: arrival, monotonic [ns],
            and the machine's time [s].
        wound: Parameters of the machine in the present run; empty where they are the command's.
        reading: Brings them.
    """

    operated = False
    throughout = False
    anew: tuple[int, float] | None = None
    reading: asyncio.Task[None] | None = None

    def __init__(self, who: Participants) -> None:
        self._who, self._machine = who, who.machine
        self.wound: Mapping[str, object] = {}

    @property
    def end(self) -> float | None:
        """Stamp of the run's last sample [s]; None while it is not known."""
        return self._machine.end

    @property
    def early(self) -> Cause | None:
        """Why its end is not the one that was asked for; None where it is, or is not reached."""
        return self._machine.early

    def over(self, t: float, *, closed: bool) -> Cause | None:
        """Return why a run is over that supervision has not ended.

        Returns:
            None for a run that came to its end.
        """
        if not closed and self.end is not None:
            return self.early
        if closed and not self.operated:
            return Cause(by=EndedBy.SIGNAL, source="SIGINT", text="SIGINT came", t=t)
        text = "the operator ended the session" if closed else "reset by the operator"
        return Cause(by=EndedBy.OPERATOR, source="dashboard", text=text, t=t)

    async def begun(self) -> None:
        """Wait until the run has begun.

        Raises:
            GraphError, TimeoutError: The machine does not begin.
        """
        await self._machine.start()
        await self._machine.begun()

    def catch_up(self) -> bool:
        """Return whether a run has begun that was not noticed before the session's end."""
        return False

    def look(self) -> bool:
        """Look what the operator does; return whether the present run is to be over at once."""
        return False

    def remark(self, sentence: str) -> None:
        """Report a remark on a machine that the run goes on with."""
        self._who.report(sentence)

    def enter(self, phase: RunPhase, reason: str = "") -> None:
        """Report a phase of the run, for a reason that the operator should know."""

    async def made_ready(self) -> None:
        """Wait until another run is wanted, and everything is ready for it."""

    async def keep_reporting(self) -> None:
        """Report again and again what the operator should know."""


class NextRun(Conduct):
    """Runs of an external machine: each begins where the machine stands when it is asked for.

    The machine may be moved by hand between two runs; `parameters` returns those of every node.
    """

    operated = True

    def __init__(
        self, who: Participants, machine: ExternalMachine, parameters: Callable[[], Parameters]
    ) -> None:
        super().__init__(who)
        self._external, self._parameters = machine, parameters
        self._phase, self._reason = RunPhase.READY, ""
        self._loop = asyncio.get_running_loop()
        self._asked = asyncio.Event()
        services.NEXT_RUN.serve(who.client.node, self._answer)

    def look(self) -> bool:
        """Return whether another run is wanted."""
        return self._asked.is_set()

    async def begun(self) -> None:
        """Wait for the first motion."""
        await self._machine.begun()
        self.enter(RunPhase.UNDER_WAY)

    def enter(self, phase: RunPhase, reason: str = "") -> None:
        """Report a phase of the run, for a reason that the operator should know."""
        self._phase, self._reason = phase, reason
        self._report()

    async def made_ready(self) -> None:
        """Make machine and nodes ready when the operator asks, again and again until they are."""
        while True:
            await self._asked.wait()
            self._asked.clear()
            self.enter(RunPhase.PREPARED)
            try:
                await self._external.reset()
                await self._machine.stand()
                await self._who.orchestrator.bring_up_anew(self._parameters())
                await self._machine.ready()
            except (GraphError, TimeoutError) as error:
                self.enter(RunPhase.OVER, f"no next run: {error}")
            else:
                self.enter(RunPhase.READY)
                return

    async def keep_reporting(self) -> None:
        """Report the phase of the run in the diagnostics, again and again."""
        while True:
            self._report()
            await asyncio.sleep(_REPORT_PERIOD)

    def remark(self, sentence: str) -> None:
        """Report a remark on the machine beside the phase of its run."""
        self.enter(self._phase, sentence)

    def _report(self) -> None:
        level = Level.WARN if self._reason else Level.OK
        message = self._reason or f"the run is {self._phase.value}"
        values = {"phase": self._phase.value}
        self._who.client.report(self._machine.t, level, COMPONENT, message, values)

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
        if self._phase is RunPhase.UNDER_WAY and not self._machine.standing:
            return "a run is under way; stop the machine first"
        return ""
