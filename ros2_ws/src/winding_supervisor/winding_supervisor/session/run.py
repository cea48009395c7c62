"""One run of the graph: own the domain, bring the nodes up, record, wind, close everything."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial

from winding_core.run_options import OperatorLimits
from winding_core.run_outcome import Cause, EndedBy, Motion, RunOutcome
from winding_recorder.live.recorder import Recorder, RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.environment import set_process_environment
from winding_ros.graph import GraphError, Policy
from winding_supervisor.machines.external_machine import ExternalMachine, MachineError
from winding_supervisor.machines.machine import Machine
from winding_supervisor.processes.orchestrator import Orchestrator
from winding_supervisor.session.dashboard_process import DashboardProcess, outlive
from winding_supervisor.session.domain_lock import chosen_domain, domain_lock
from winding_supervisor.session.external_session import ExternalSession, NextRun
from winding_supervisor.session.interruption import Interruption, ended_if_stuck, run_closing
from winding_supervisor.session.machine_run import MachineRun, View
from winding_supervisor.session.operator_run import (
    SESSION_ENDED,
    OperatedRun,
    OperatorRun,
    parameter_notes,
)
from winding_supervisor.session.outcome_status import tell_outcome
from winding_supervisor.session.rest import Rest
from winding_supervisor.session.run_config import RunConfig, check_run, claim_folder
from winding_supervisor.session.run_parts import (
    TraceRecording,
    describe_machine,
    graph_config,
    new_machine,
    new_recorder,
    page_config,
)
from winding_supervisor.session.run_result import RunResult
from winding_supervisor.watch.event_log import EventLog
from winding_supervisor.watch.supervisor import RunEndedError, Supervisor, replay_parameters

Report = Callable[[str], None]
Deliver = Callable[[RunResult], RunOutcome | None]

# A machine that does not stop is asked for so long where no operator is present [s].
_UNATTENDED = 10.0
# The middleware has so long to close; Fast DDS has been seen in a deadlock [s].
_CLOSING = 20.0


@contextmanager
def opened_run(config: RunConfig) -> Iterator[Run]:
    """Check a run and yield it, with its domain locked and its folder made.

    Its middleware is closed at the end of the body, after everything that a run leaves is written.

    Raises:
        ParameterError, RecorderError, RunFolderError, ValueError: As in `check_run`.
        DomainError: Domain and namespace are taken.
        OSError: The folder cannot be made.
    """
    check_run(config)
    domain = chosen_domain(config.domain)
    with domain_lock(domain, config.namespace):
        claimed = replace(config, directory=claim_folder(config))
        set_process_environment(domain, claimed.log_directory)
        run = Run(claimed)
        try:
            yield run
        finally:
            with ended_if_stuck(_CLOSING, claimed.directory / "closing.txt"):
                run.middleware.close()


@dataclass(frozen=True, kw_only=True)
class _Session:
    """Who takes part in a session that an operator conducts."""

    client: AsyncClient
    machine: Machine
    orchestrator: Orchestrator
    supervisor: Supervisor
    recorder: Recorder
    page: DashboardProcess
    ended: asyncio.Event
    rest: Rest


class Run:
    """A run whose domain and folder are its own.

    Attributes:
        config: Of the run; its directory is the folder that was made.
        middleware: What is left to close when everything is written.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config
        self.middleware = ExitStack()
        self._log = EventLog(file=config.directory / "events.jsonl")
        self._operated: OperatorRun | None = None
        self._bags = 0
        self._rest: Rest | None = None
        self._delivered = False
        self._recorder_of_run: Recorder | None = None
        self._following: MachineRun | None = None
        self._trace: TraceRecording | None = None
        self._dashboard: DashboardProcess | None = None

    def wind(
        self, view: View, report: Report = print, deliver: Deliver | None = None
    ) -> RunResult | None:
        """Run the graph once from start to finish, or as an operator conducts it.

        Args:
            view: Called a few times per second with the buffer so far and the wall time [s].
            report: Takes the sentence with the address of the operator's page.
            deliver: Takes every run of an operator as soon as it is over, in a thread of its own.

        Returns:
            What the run leaves; None where everything has been delivered.

        Raises:
            GraphError: A node refused or died; what was recorded until then is kept.
            KeyboardInterrupt: A signal ended the run; every process has ended, the bag is closed.
        """

        async def work(stack: AsyncExitStack, interruption: Interruption) -> Recorder:
            try:
                return await self._wind(stack, interruption, view, report, deliver or _drop)
            except RunEndedError:
                raise
            except asyncio.CancelledError:
                self._end(EndedBy.SIGNAL, interruption.signal, f"{interruption.signal} came")
                raise
            except MachineError as error:
                self._end(EndedBy.MACHINE, topics.RIG, str(error))
                raise
            except (GraphError, TimeoutError, OSError) as error:
                self._end(EndedBy.FAULT, topics.ORCHESTRATOR, str(error))
                raise

        recorder = run_closing(work)
        if self._delivered or self._operated:
            return None
        if self.config.page is not None:
            if recorder.buffer.time <= 0.0:
                return None
            self._end(EndedBy.OPERATOR, topics.ORCHESTRATOR, SESSION_ENDED)
        return self._result(recorder)

    def remains(self) -> list[RunResult]:
        """Return what runs leave that ended early and were not delivered."""
        recorder = self._recorder_of_run
        if recorder is None or self._delivered:
            return []
        if self._operated is not None:
            runs = self._operated.remaining()
            return [self._operated_result(recorder, run) for run in runs if run.buffer.time > 0.0]
        if self._following is None or not self._following.begun or recorder.buffer.time <= 0.0:
            return []
        return [self._result(recorder)]

    def _end(self, by: EndedBy, source: str, text: str) -> None:
        t = None if self._recorder_of_run is None else self._recorder_of_run.buffer.time
        self._log.end(Cause(by=by, source=source, text=text, t=t))

    def _result(self, recorder: Recorder) -> RunResult:
        return RunResult(
            buffer=recorder.buffer,
            wall_s=0.0 if self._following is None else self._following.wall_s,
            ending=self._log.ending(Motion.STANDING if self._rest is None else self._rest.motion),
            losses=self._losses(recorder),
            bags=recorder.bags.present(self._bags),
            limits=self._limits(),
            simulated=self.config.machine is None,
            trace=None if self._trace is None else self._trace.since(recorder.buffer.begun_ns),
        )

    def _losses(self, recorder: Recorder) -> tuple[str, ...]:
        recording = f"the recording is incomplete: {recorder.error}" if recorder.error else ""
        gone = (
            f"the recording {folder} is gone"
            for folder in recorder.bags.folders[self._bags :]
            if not folder.exists()
        )
        return tuple(filter(None, (recording, *gone, *recorder.shortfalls, self._log.failure)))

    def _limits(self) -> OperatorLimits | None:
        return None if self._dashboard is None else self._dashboard.limits

    def _operated_result(self, recorder: Recorder, run: OperatedRun) -> RunResult:
        return RunResult(
            buffer=run.buffer,
            wall_s=run.wall_s,
            ending=run.ending,
            losses=self._losses(recorder),
            wound=run.wound,
            bags=run.bags,
            limits=run.limits,
            trace=None if self._trace is None else self._trace.since(run.buffer.begun_ns),
        )

    async def _wind(
        self,
        stack: AsyncExitStack,
        interruption: Interruption,
        view: View,
        report: Report,
        deliver: Deliver,
    ) -> Recorder:
        config = self.config
        client = AsyncClient(config.namespace)
        self.middleware.callback(client.close)
        recorder = self._recorder_of_run = new_recorder(config, client)
        # It publishes until everything is stored, so it is closed before the client.
        stack.callback(recorder.close)
        if config.trace:
            self._trace = TraceRecording(client.node)
        client.start()
        machine = new_machine(config, client, recorder.buffer)
        await machine.stand()
        axes = machine.parameters()
        describe_machine(config, axes, client.node, report)
        if axes:
            recorder.bags.note(parameter_notes(config.parameters(axes)))
        orchestrator = Orchestrator(graph_config(config, axes), client, report)
        supervisor = Supervisor(
            orchestrator,
            machine,
            client,
            recorder.buffer,
            self._log,
            {
                spec.name: partial(self._replay, recorder.buffer, spec.name)
                for spec in config.graph
                if spec.policy is Policy.REPLAY
            },
            operated=config.page is not None,
        )
        page: DashboardProcess | None = None
        served = page_config(config, axes)
        if served is not None:
            page = DashboardProcess(served, client, self._log, lambda: supervisor.t)
            self._dashboard = page
            stack.push_async_callback(page.kill)
            stack.push_async_callback(interruption.unless_hastened, page.stop)
        stack.push_async_callback(orchestrator.kill)
        stack.push_async_callback(interruption.unless_hastened, orchestrator.stop)
        rest = self._rest = Rest(machine, self._log, client, report)
        stack.push_async_callback(interruption.unless_hastened, partial(self._leave, interruption))
        await orchestrator.start()
        await orchestrator.bring_up()
        await stack.enter_async_context(supervisor.beating())
        # Before the page: what it offers may be pressed as soon as it is served.
        await machine.ready()
        ended = asyncio.Event()
        if page is not None:
            await page.start()
            report(f"operator's page: {page.url}  (Start is there; Ctrl-C here ends the run)")
        if page is None:
            if not machine.simulated:
                report("ready; Ctrl-C ends the run")
                interruption.instead_of_sigint(ended.set)
            self._following = MachineRun(machine, recorder.buffer, operated=False)
            await self._following.follow(view, ended.is_set, (supervisor.watch(),), report)
            self._note_end(machine, cut=ended.is_set())
            return recorder
        interruption.instead_of_sigint(ended.set)
        session = _Session(
            client=client,
            machine=machine,
            orchestrator=orchestrator,
            supervisor=supervisor,
            recorder=recorder,
            page=page,
            ended=ended,
            rest=rest,
        )
        try:
            await self._conduct(session, view, report, deliver)
        except (GraphError, TimeoutError) as error:
            if not isinstance(error, RunEndedError):
                by = EndedBy.MACHINE if isinstance(error, MachineError) else EndedBy.FAULT
                self._end(by, topics.ORCHESTRATOR, str(error))
            report(f"the session cannot go on: {error}; the page stays, Ctrl-C here ends it")
            await rest.bring()
            await orchestrator.stop()
            for result in self.remains():
                outcome = await asyncio.to_thread(deliver, result)
                tell_outcome(client, machine.t, outcome)
            self._delivered = True
            await outlive(str(error), page, client, ended)
            raise
        return recorder

    async def _conduct(
        self, session: _Session, view: View, report: Report, deliver: Deliver
    ) -> None:
        """Follow what an operator does with the machine until the session ends."""
        if isinstance(session.machine, ExternalMachine):
            report("ready; Ctrl-C ends the session")
            next_run = NextRun(
                session.client, lambda: session.machine.t, lambda: session.machine.standing
            )
            external = ExternalSession(
                session.machine,
                session.orchestrator,
                session.supervisor,
                next_run,
                session.ended,
                lambda: self.config.own_parameters(session.machine.parameters()),
                session.rest,
            )
            await external.follow(
                partial(self._next, session),
                view,
                partial(self._take_external, session),
                partial(self._deliver_external, session, deliver, report),
                session.page.keep(),
            )
            return
        self._operated = OperatorRun(
            session.client,
            session.orchestrator,
            session.recorder,
            session.ended,
            self._log,
            lambda run: deliver(self._operated_result(session.recorder, run)),
            self._limits,
            self.config.parameters()[topics.RIG],
        )
        await self._operated.follow((session.supervisor.watch(), session.page.keep()), view)

    def _next(self, session: _Session) -> MachineRun:
        """Return what follows the next run of a machine that an operator conducts."""
        machine, recorder = session.machine, session.recorder
        tell_outcome(session.client, machine.t, None)
        parameters = self.config.parameters(machine.parameters())
        recorder.bags.note(parameter_notes(parameters))
        self._delivered = False
        self._log.begin_run()
        self._following = MachineRun(machine, recorder.buffer, operated=True)
        return self._following

    def _note_end(self, machine: Machine, *, cut: bool) -> None:
        """Note why a run is over that supervision has not ended."""
        if machine.end is None or cut:
            self._end(EndedBy.SIGNAL, "SIGINT", "SIGINT came")
        elif machine.early is not None:
            self._log.end(machine.early)

    async def _leave(self, interruption: Interruption) -> None:
        """Leave the machine at rest; what may still move is stayed at."""
        assert self._rest is not None
        if not await self._rest.bring():
            return
        interruption.instead_of_sigint(self._rest.confirmed.set)
        attended = self.config.page is not None or self.config.attended
        await self._rest.hold(math.inf if attended else _UNATTENDED)

    async def _take_external(self, session: _Session) -> RunResult | None:
        """Bring the machine to rest; return what the run leaves, None where none has begun."""
        machine, recorder = session.machine, session.recorder
        await session.rest.bring()
        if recorder.buffer.time <= 0.0:
            return None
        if machine.end is None:
            self._end(EndedBy.OPERATOR, "dashboard", "reset by the operator")
        elif machine.early is not None:
            self._log.end(machine.early)
        return replace(self._result(recorder), buffer=recorder.buffer.before())

    async def _deliver_external(
        self, session: _Session, deliver: Deliver, report: Report, result: RunResult
    ) -> None:
        outcome = await asyncio.to_thread(deliver, result)
        tell_outcome(session.client, session.machine.t, outcome)
        self._delivered = True
        self._bags = len(session.recorder.bags.folders)
        report("the run is over; Reset on the page begins the next, Ctrl-C here ends the session")

    def _replay(self, buffer: RunBuffer, name: str) -> dict[str, object]:
        """Return the parameters with which a restarted node takes up the run."""
        if not self.config.attach:
            return replay_parameters(buffer, self.config.log_directory / f"{name}_inputs.npy")
        if name == topics.FEM:
            raise GraphError(
                f"{name} was lost and runs elsewhere, where it cannot replay the run's inputs"
            )
        return {}


def _drop(_: RunResult) -> None:
    """Drop a run."""
