"""Watch a running graph: notice what fails, stop the machine first, then act by the policy."""

import asyncio
import os
import time
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NoReturn

from winding_core.machine.watch_clock import WatchClock
from winding_core.run_outcome import Cause, EndedBy
from winding_core.status import Level
from winding_recorder.live.recorder import RunBuffer
from winding_recorder.live.run_buffer import buffered_inputs
from winding_ros import topics
from winding_ros.client.async_client import NAME, AsyncClient
from winding_ros.graph import GraphError, Policy
from winding_ros.runtime.heartbeat import Sign
from winding_supervisor.machines.machine import Machine
from winding_supervisor.processes.beside import beside
from winding_supervisor.processes.discovery import RivalWatch
from winding_supervisor.processes.node_process import Backoff
from winding_supervisor.processes.orchestrator import Orchestrator
from winding_supervisor.watch.event_log import EventLog
from winding_supervisor.watch.load_monitor import LoadMonitor
from winding_supervisor.watch.sensor_watch import SensorWatch

_LOOK_PERIOD = 0.05
_BEAT_PERIOD = 0.1
_CENSUS_PERIOD = 0.25
_LOAD_PERIOD = 1.0
# The axes have so long to stand after a stop [s].
_STAND_TIMEOUT = 3.0
_STALLS = 2


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something that failed."""

    node: str  # Node or signal
    text: str  # What is wrong with it, to follow its name
    fatal: bool  # Whether the run cannot go on whatever the node's policy
    wall: float  # When it was noticed, monotonic [s]
    by: EndedBy = EndedBy.SUPERVISION  # Who ends the run if this does


class RunEndedError(GraphError):
    """Supervision has ended the run; the log has the cause."""


@dataclass(eq=False)
class Supervisor:
    """Supervises one run of a graph.

    The operating system reports crashes. DDS reports hangs: a stopped process loses its liveliness
    within 0.8 s, one whose work no longer ends misses its deadline of 3 s twice. A process that
    merely gets no processor loses its liveliness too; the operating system knows the difference.
    Stamps show a silent sensor, the machine itself reports an implausible one. The machine is
    stopped before anything else is done.
    """

    orchestrator: Orchestrator  # Whose processes
    machine: Machine  # What moves
    client: AsyncClient  # The orchestrator's node
    buffer: RunBuffer  # Messages of the graph so far
    log: EventLog  # Where events go
    # Writes the run's inputs so far and returns the parameters with which a node replays them, by
    # node
    replay: Mapping[str, Callable[[], dict[str, object]]]
    # Whether an operator starts and stops the machine. Then supervision does not start it, and
    # ignores what nodes do while it stands.
    operated: bool = False

    def __post_init__(self) -> None:
        self._graph = self.orchestrator.config.graph
        self._findings: asyncio.Queue[Finding] = asyncio.Queue()
        self._healthy: set[str] = set()
        self._misses: Counter[str] = Counter()
        self._backoff: dict[str, Backoff] = defaultdict(Backoff)
        self._sensors = SensorWatch()
        self._rivals = RivalWatch(self.client.node, (spec.name for spec in self._graph))
        self._ends: dict[str, asyncio.Task[None]] = {}
        # Restarted while another node was down, so that not all of its topics have partners.
        self._unmatched: set[str] = set()

    @asynccontextmanager
    async def beating(self) -> AsyncIterator[None]:
        """Give the signs of life that keep the machine moving."""
        for spec in self._graph:
            self.client.watch(spec.name, partial(self._note_sign, spec.name))
        async with beside(self._beat()):
            yield

    async def watch(self) -> None:
        """Supervise until something ends the run.

        Raises:
            RunEndedError: Why the run cannot go on; the log has stops and first cause.
            GraphError: A process cannot be started again.
        """
        self._findings = asyncio.Queue()
        self._sensors.forget()
        for spec in self._graph:
            self._trust(spec.name)
        watched = (self._look(), self._look_for_rivals(), self._publish_load())
        try:
            async with beside(*watched) as tasks:
                while True:
                    await self._handle(await self._next_finding(tasks))
        except (TimeoutError, ValueError) as error:
            raise GraphError(str(error)) from error
        finally:
            for task in self._ends.values():
                task.cancel()

    async def _next_finding(self, watching: Sequence[asyncio.Task[None]]) -> Finding:
        """Return what fails next; whoever watches may end, but not by an error of its own."""
        async with beside(self._findings.get()) as (coming,):
            while not coming.done():
                for task in watching:
                    if task.done():
                        task.result()
                going = [task for task in watching if not task.done()]
                await asyncio.wait([coming, *going], return_when=asyncio.FIRST_COMPLETED)
            finding: Finding = coming.result()
            return finding

    @property
    def _left_alone(self) -> bool:
        """Whether a machine stands that may, so that nodes may be silent and topics late."""
        may_stand = self.operated or not self.machine.simulated
        return may_stand and not self.machine.moving

    def _trust(self, name: str) -> None:
        self._healthy.add(name)
        self._misses[name] = 0
        self._ends[name] = asyncio.create_task(self._await_end(name))

    async def _await_end(self, name: str) -> None:
        process = self.orchestrator.process(name)
        code = await process.ended()
        self._find(name, f"ended with exit code {code}")

    def _note_sign(self, name: str, sign: Sign) -> None:
        process = self.orchestrator.process(name)
        # The operating system reports a process that has ended, with its exit code.
        if process.return_code is not None or name not in self._healthy:
            return
        if sign is Sign.ALIVE:
            self._misses[name] = 0
        elif sign is Sign.STALLED:
            # Models are built while nothing moves.
            if self._left_alone:
                return
            # A process that gets no processor is late; one that hangs is late again and again.
            self._misses[name] += 1
            if self._misses[name] >= _STALLS:
                self._find(name, sign.value)
        elif sign is Sign.REPLACED:
            # The orchestrator knows of its own processes; an attached node has forgotten the run.
            if not process.started:
                self._find(name, sign.value)
        elif process.stopped:
            self._find(name, sign.value)

    def _find(
        self, node: str, text: str, *, fatal: bool = False, by: EndedBy = EndedBy.SUPERVISION
    ) -> None:
        """Take note of a failure, once for as long as it is dealt with."""
        known = node in {spec.name for spec in self._graph}
        if known and not fatal:
            if node not in self._healthy:
                return
            self._healthy.discard(node)
        self._findings.put_nowait(
            Finding(node=node, text=text, fatal=fatal, wall=time.monotonic(), by=by)
        )

    async def _beat(self) -> None:
        while True:
            self.client.beat()
            await asyncio.sleep(_BEAT_PERIOD)

    async def _look(self) -> None:
        """Watch the stamps of the sensors and the diagnostics of the nodes."""
        clock = WatchClock()
        givers = {spec.answer: spec.name for spec in self._graph if spec.answer is not None}
        names = {topic.name: name for topic, name in givers.items()}

        def at_work(topic: str) -> bool:
            return self.orchestrator.process(names[topic]).wants_processor

        while True:
            await asyncio.sleep(_LOOK_PERIOD)
            complaint = self.machine.complaint()
            if complaint:
                self._find(self.machine.name, complaint, fatal=True, by=EndedBy.MACHINE)
                return
            # A node that is given nothing it can use has asked the machine to stop by itself. One
            # that was not activated since a reset cannot use the readings of the next run.
            for name in () if self._left_alone and self.machine.simulated else self._healthy:
                status = self.client.status(f"{name}: topics")
                if status is not None and status.level >= Level.ERROR:
                    self._find(name, status.message, fatal=True)
                    return
            sensors = {topic.name: self.buffer.last_stamp(topic) for topic in self.machine.sensors}
            awake = min(sensors.values()) >= 0.0 and len(self._healthy) == len(self._graph)
            if self._left_alone or not awake:
                self._sensors.forget()
                continue
            answers = {topic.name: self.buffer.last_stamp(topic) for topic in givers}
            now = clock.look(time.monotonic())
            wrong = self._sensors.look(now, sensors, answers, at_work)
            if wrong is not None:
                self._find(*wrong, fatal=True)
                return

    async def _look_for_rivals(self) -> None:
        """Look who else publishes on the topics of the graph."""
        contested = None
        while contested is None:
            await asyncio.sleep(_CENSUS_PERIOD)
            contested = self._rivals.look(time.monotonic())
        self._find(*contested, fatal=True)

    async def _publish_load(self) -> None:
        load = LoadMonitor(self.buffer)
        # Rates and loads are those since the last look.
        load.look(time.monotonic(), self._pids())
        while True:
            await asyncio.sleep(_LOAD_PERIOD)
            level, message, values = load.look(time.monotonic(), self._pids())
            self.client.report(self.machine.t, level, "vitals", message, values)

    def _pids(self) -> dict[str, int]:
        return {**self.orchestrator.pids(), NAME: os.getpid()}

    async def _handle(self, finding: Finding) -> None:
        self._note("detected", finding.node, finding.text, wall=finding.wall)
        when = self.machine.when
        cause = Cause(
            by=finding.by,
            source=finding.node,
            text=f"{finding.node} {finding.text} {when}",
            t=self.buffer.time,
        )
        if finding.node == topics.RIG and not finding.fatal:
            # No process is left that could stop the axes; its process goes, and its drives with it.
            process = self.orchestrator.process(topics.RIG)
            await process.kill()
            complaint = process.complaint()
            self._end(replace(cause, text=f"{cause.text}: {complaint}") if complaint else cause)
        if self._left_alone and not self.machine.built:
            # Nothing can move, and whoever was preparing it waits for this node in vain.
            self._end(cause)
        idle = self._left_alone
        self.log.hold(cause)
        if finding.fatal:
            # It is asked before the census, and again by what sees to it that it stands.
            await self.machine.quick_stop()
            behind = await self._behind(cause, when)
            self.log.release(cause)
            self.log.hold(behind)
            await self._stop_machine(behind)
            self._end(behind)
        await self._stop_machine(cause)
        policy = next((spec.policy for spec in self._graph if spec.name == finding.node), None)
        if policy is None:
            self._end(cause)
        if policy is Policy.END:
            await self.orchestrator.process(finding.node).kill()
            self._end(cause)
        await self._start_again(cause, policy)
        if idle:
            # Nothing was wound that it could have ended.
            self.log.release(cause)

    async def _behind(self, cause: Cause, when: str) -> Cause:
        """Return the second publisher behind what a node or the machine refused, or the cause.

        Its messages are refused as soon as they arrive, which may be ahead of the census.
        """
        await asyncio.sleep(_CENSUS_PERIOD)
        contested = self._rivals.look(time.monotonic())
        if contested is None or contested[0] == cause.source:
            return cause
        topic, text = contested
        self._note("detected", topic, text)
        by = EndedBy.SUPERVISION
        return replace(cause, by=by, source=topic, text=f"{topic} {text} {when}")

    async def _stop_machine(self, cause: Cause) -> None:
        failure = await self.machine.quick_stop()
        if failure and self.machine.simulated:
            await self.orchestrator.process(topics.RIG).kill()
            failure += " and was killed"
        self.log.stop(self.machine.t, "supervision", failure)
        if failure:
            self._note("not stopped", topics.RIG, failure)
            self._end(cause)
        self._note("stopped", topics.RIG, "rig/quick_stop")
        end = time.monotonic() + _STAND_TIMEOUT
        while not self.machine.standing:
            if time.monotonic() > end:
                limit = f"{_STAND_TIMEOUT:g} s"
                self._note("not stopped", topics.RIG, f"does not stand {limit} after the stop")
                self._end(cause)
            await asyncio.sleep(0.01)
        self._note("standing", topics.RIG, "both axes stand")

    async def _start_again(self, cause: Cause, policy: Policy) -> None:
        name = cause.source
        wait = self._backoff[name].next_wait(time.monotonic())
        if wait is None:
            self._end(replace(cause, text=f"{cause.text}, for the fourth time within a minute"))
        await asyncio.sleep(wait)
        extra = self.replay[name]() if policy is Policy.REPLAY else {}
        self._note("restarting", name, policy.value)
        await self.orchestrator.restart(name, extra, partial(self._note, "restarting", name))
        self._note("restarted", name, "active again")
        self._trust(name)
        self._unmatched.add(name)
        if not self._findings.empty():
            # Another node is down as well: it is dealt with first.
            return
        await self.orchestrator.rematch(sorted(self._unmatched))
        self._unmatched.clear()
        # An operator may have pressed Stop while the machine stood; Start is theirs.
        if self._findings.empty() and not self.operated:
            await self.machine.start()
            self._note("resumed", topics.RIG, "rig/start")
            self.log.resume()
        self._sensors.forget()

    def _end(self, cause: Cause) -> NoReturn:
        first = self.log.end(cause)
        self._note("ended", first.source, first.text, sentence=first.text)
        raise RunEndedError(first.text)

    def _note(
        self, what: str, node: str, text: str, *, wall: float | None = None, sentence: str = ""
    ) -> None:
        self.log.note(what, node, text, t=self.machine.t, wall=wall)
        level = Level.OK if what in ("restarted", "resumed") else Level.ERROR
        values = {"time": f"{self.machine.t:.3f}"}
        about = sentence or f"{node} {text}"
        self.client.report(self.machine.t, level, "supervision", f"{what}: {about}", values)


def replay_parameters(buffer: RunBuffer, file: Path, since: float = 0.0) -> dict[str, object]:
    """Write the run's inputs so far into a file; return the parameters that replay them.

    Args:
        buffer: Messages of the graph.
        file: Where the inputs go.
        since: When the run began, monotonic wall time [s].
    """
    buffered_inputs(buffer, since).write(file)
    return {"replay": str(file)}
