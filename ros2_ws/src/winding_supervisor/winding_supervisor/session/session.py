"""A session of runs: each is waited for, followed, brought to rest, delivered; then the next."""

import asyncio
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from winding_core.run_options import OperatorLimits
from winding_core.run_outcome import Ending, RunOutcome, Verdict
from winding_core.status import OUTCOME_COMPONENT, Level, RunPhase
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.graph import FEM, RIG, GraphError
from winding_ros.topic import Topic
from winding_supervisor.processes.beside import beside
from winding_supervisor.session.conduct import Conduct
from winding_supervisor.session.participants import Participants

# Messages may be lost at the very end of a run: nothing more comes after so long.
_LAST_MESSAGES = 1.0
# Stamps are whole nanoseconds.
_ROUNDING = 1e-6
_PROCESSED = (topics.JOINT_STATES, topics.FEM_MARKERS, topics.CORRECTED_MARKERS)
_TRACKED = (topics.CAMERA_INFO, topics.TRACKED_MARKERS)
# Topics come each in a stream of its own: the last picture may arrive after what was made of it.
_PUBLISHED = tuple(topic for topic in (*RIG.publishes, *FEM.publishes) if topic.rate)


class Completion:
    """Tells when each node has processed a run's last sample."""

    def __init__(self, end: float, *, camera: bool = True) -> None:
        self._end = end
        self._camera = camera
        self._last: list[float] | None = None
        self._since = math.inf

    def reached(self, buffer: RunBuffer, now: float) -> bool:
        """Return whether the buffer has everything, as far as wall time `now` [s] shows."""
        if not all(self._ends(topic, buffer) for topic in _PROCESSED):
            return False
        heard = [topic for topic in _PUBLISHED if buffer.last_stamp(topic) >= 0.0]
        awaited = (*heard, *(_TRACKED if self._camera else ()))
        late = [topic for topic in awaited if not self._ends(topic, buffer)]
        if not late:
            return True
        # Frames may be tracked for long; what else is still to come is under way.
        last = [buffer.last_stamp(topic) for topic in late if topic in _TRACKED]
        if last != self._last:
            self._last, self._since = last, now
        return now - self._since >= _LAST_MESSAGES

    def _ends(self, topic: Topic, buffer: RunBuffer) -> bool:
        assert topic.rate is not None
        return buffer.last_stamp(topic) > self._end - 1.0 / topic.rate + _ROUNDING


_POLL = 0.05
_VIEW_PERIOD = 0.25
_LEVELS = {Verdict.FAILED: Level.ERROR, Verdict.NOT_GOOD: Level.WARN}

View = Callable[[RunBuffer, float], None]


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a run leaves."""

    buffer: RunBuffer  # Every message but the pictures
    wall_s: float  # How long the run took [s]
    ending: Ending  # Who or what ended it
    began: datetime | None = None  # UTC; None for one that is read from its recording
    losses: tuple[str, ...] = ()  # What of its files is missing, a sentence each
    # Parameters of the machine in a run that an operator conducted; empty when none was begun
    wound: Mapping[str, object] = field(default_factory=dict)
    bags: tuple[Path, ...] = ()  # What was recorded
    limits: OperatorLimits | None = None  # Of the operator's page at its end
    simulated: bool = True  # Whether its machine was the simulated one, sampled at known instants
    # What the nodes noted of the corrected lengths, TRACE_DTYPE, shape (n,); None without a trace
    trace: NDArray[np.void] | None = None


@dataclass(kw_only=True, eq=False)
class _Run:
    """A run of the session, from waiting for it to its delivery."""

    since: float  # When it was begun to be waited for, then when it began; monotonic [s]
    begun: bool = False  # Whether its machine has begun
    over: float | None = None  # When it was over, monotonic [s]; None before
    buffer: RunBuffer | None = None  # Its own, once it is over; nothing is added to it
    ending: Ending = field(default_factory=Ending)
    folders: tuple[Path, ...] = ()  # Of what was recorded meanwhile
    wound: Mapping[str, object] = field(default_factory=dict)  # Empty while it is being read

    @property
    def wall_s(self) -> float:
        """How long it took, or has taken so far [s]."""
        return (self.over or time.monotonic()) - self.since


@dataclass(eq=False)
class Session:
    """Follows one run, or run after run until the operator ends the session.

    Every run that was begun is left once: to `deliver` when it is over and another may follow, to
    `remains` when it is the last. The recorder's buffer keeps the present run alone.
    """

    who: Participants  # Takes part
    conduct: Conduct  # How runs begin
    # Takes a run of an operator that is over, in a thread of its own
    deliver: Callable[[RunResult], RunOutcome | None]
    ready: Callable[[], None]  # Is called when another run may begin

    def __post_init__(self) -> None:
        self.ended = asyncio.Event()  # Set when the operator ends the session
        self._run = _Run(since=time.monotonic())
        self._before: _Run | None = None
        self._undelivered: list[_Run] = []
        self._delivering: asyncio.Task[None] | None = None
        self._beside: list[asyncio.Task[None]] = []
        self._bags = 0
        self._shown = -math.inf
        self._remarked = ""

    async def follow(self, view: View) -> None:
        """Return when the run, or the session, is over.

        Args:
            view: Called a few times per second with the buffer and the wall time [s].

        Raises:
            GraphError, TimeoutError: It cannot go on.
        """
        who, conduct = self.who, self.conduct
        work = [conduct.keep_reporting()] if conduct.operated else []
        if who.page is not None:
            work.append(who.page.keep())
        if conduct.throughout:
            work.append(who.supervisor.watch())
        self._beside = [asyncio.create_task(item) for item in work]
        try:
            while not self.ended.is_set():
                await self._follow_run(view)
                if self.ended.is_set() or not conduct.operated:
                    break
                await self._change_over()
            if self._delivering is not None:
                await self._delivering
        except (GraphError, TimeoutError):
            conduct.enter(RunPhase.FAILED)
            raise
        finally:
            for task in (*self._beside, *([conduct.reading] if conduct.reading else [])):
                task.cancel()

    async def _follow_run(self, view: View) -> None:
        """Follow the present run from waiting for it until every node has dealt with its end."""
        who, conduct, run = self.who, self.conduct, self._run
        buffer = who.recorder.buffer
        watched = [] if conduct.throughout else [who.supervisor.watch()]
        completion: Completion | None = None
        async with beside(conduct.begun(), *watched) as tasks:
            begun = tasks[0]
            while completion is None or not completion.reached(buffer, time.monotonic()):
                if self.ended.is_set() or conduct.look():
                    break
                for task in filter(
                    None, (*tasks, *self._beside, self._delivering, conduct.reading)
                ):
                    if task.done():
                        task.result()
                if begun.done() and not run.begun:
                    run.begun, run.since = True, time.monotonic()
                    if conduct.operated:
                        self.publish_outcome(None)
                end = conduct.end if run.begun else None
                if end is None:
                    completion = None
                elif completion is None:
                    camera = topics.CAMERA_INFO in who.machine.sensors
                    completion = Completion(end, camera=camera)
                self._show(view)
                await asyncio.sleep(_POLL)
            self._show(view, now=True)
        run.over = time.monotonic()
        run.begun = run.begun or conduct.catch_up()
        if run.begun or not conduct.operated:
            # The machine may have wound on to its end while it was asked to stop.
            cause = conduct.over(buffer.time, closed=self.ended.is_set()) or who.log.held
            if cause is not None:
                who.log.end(cause)

    def _show(self, view: View, *, now: bool = False) -> None:
        if not now and time.monotonic() - self._shown < _VIEW_PERIOD:
            return
        self._shown = time.monotonic()
        shown = self._run if self._run.begun or self._before is None else self._before
        view(self.who.recorder.buffer, shown.wall_s)
        remark = self.who.machine.remark()
        if remark and remark != self._remarked:
            self.conduct.remark(remark)
        self._remarked = remark

    async def _change_over(self) -> None:
        """Bring the machine to rest, let the run be delivered, and wait until another may begin."""
        who, conduct = self.who, self.conduct
        await who.rest.bring()
        conduct.enter(RunPhase.OVER)
        if self._run.begun and who.recorder.buffer.time > 0.0:
            self._close(conduct.anew)
            self._delivering = asyncio.create_task(
                self._deliver_run(self._undelivered[-1], conduct.reading, self._delivering)
            )
        self._run = _Run(since=time.monotonic())
        if conduct.throughout:
            await conduct.made_ready()
            return
        if self._delivering is not None:
            await self._delivering
        work = conduct.made_ready(), self.ended.wait(), who.rest.hold(math.inf)
        async with beside(*work) as (preparing, ending, _):
            awaited = [preparing, ending, *self._beside]
            await asyncio.wait(awaited, return_when=asyncio.FIRST_COMPLETED)
            for task in (*self._beside, preparing):
                if task.done():
                    task.result()
        if not self.ended.is_set():
            self.publish_outcome(None)
            who.log.begin_run()
            self.ready()

    def _close(self, cut: tuple[int, float] | None = None) -> None:
        """Take what the present run leaves."""
        run, recorder, conduct = self._run, self.who.recorder, self.conduct
        run.over = run.over or time.monotonic()
        run.buffer = recorder.buffer.before(None if cut is None else cut[0])
        if conduct.reading is None or conduct.reading.done():
            run.wound = dict(conduct.wound)
        run.ending = self.who.log.ending(self.who.rest.motion)
        run.folders = tuple(recorder.bags.folders[self._bags :])
        if cut is not None and run.folders and not _has_begun(run.folders[-1]):
            run.folders = run.folders[:-1]
        self._bags += len(run.folders)
        self.who.log.begin_run()
        self._undelivered.append(run)
        self._before = run

    async def _deliver_run(self, run: _Run, *awaited: asyncio.Task[None] | None) -> None:
        for task in awaited:
            if task is not None:
                await task
        if run not in self._undelivered:
            return
        self._undelivered.remove(run)
        outcome = await asyncio.to_thread(self.deliver, self._result(run))
        if not self._run.begun:
            self.publish_outcome(outcome)
        if not self.conduct.throughout:
            self.who.report(
                "the run is over; Reset on the page begins the next, Ctrl-C here ends the session"
            )

    def remains(self) -> list[RunResult]:
        """Return, once, what runs leave that were not delivered."""
        run, operated = self._run, self.conduct.operated
        # One that was followed to its end is whole although nothing may have moved in it.
        whole = not operated and run.over is not None
        if whole or (run.begun and self.who.recorder.buffer.time > 0.0):
            self._close()
            self._run = _Run(since=time.monotonic())
        left, self._undelivered = self._undelivered, []
        return [self._result(run) for run in left]

    def _result(self, run: _Run) -> RunResult:
        who = self.who
        assert run.buffer is not None
        return RunResult(
            buffer=run.buffer,
            wall_s=run.wall_s,
            began=datetime.now(UTC) - timedelta(seconds=time.monotonic() - run.since),
            ending=run.ending,
            losses=self._losses(run),
            wound=run.wound or dict(self.conduct.wound),
            bags=tuple(folder for folder in run.folders if any(folder.glob("*.mcap"))),
            limits=None if who.page is None else who.page.limits,
            simulated=who.machine.simulated,
            trace=None if who.trace is None else who.trace.since(run.buffer.begun_ns),
        )

    def _losses(self, run: _Run) -> tuple[str, ...]:
        recorder = self.who.recorder
        recording = f"the recording is incomplete: {recorder.error}" if recorder.error else ""
        gone = (f"the recording {folder} is gone" for folder in run.folders if not folder.exists())
        return tuple(filter(None, (recording, *gone, *recorder.shortfalls, self.who.log.failure)))

    def publish_outcome(self, outcome: RunOutcome | None) -> None:
        """Publish the outcome of a run that is over; None once another run begins."""
        client, t = self.who.client, self.who.machine.t
        if outcome is None:
            client.report(t, Level.OK, OUTCOME_COMPONENT, "no run is over", {})
            return
        values = {"verdict": outcome.verdict.value, "sentences": "\n".join(outcome.sentences)}
        level = _LEVELS.get(outcome.verdict, Level.OK)
        client.report(t, level, OUTCOME_COMPONENT, outcome.headline, values)


def _has_begun(bag: Path) -> bool:
    """Return whether a bag is of the run before, not one that has been made for the next."""
    return not bag.exists() or any(bag.glob("*.mcap"))
