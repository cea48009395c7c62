"""One run of the graph: own the domain, bring the nodes up, record, wind, close everything."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import AsyncExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial

from winding_core.run_options import OperatorLimits
from winding_recorder.live.recorder import Recorder, RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.environment import set_process_environment
from winding_ros.graph import GraphError, Policy
from winding_supervisor.machines.external_machine import ExternalMachine
from winding_supervisor.machines.machine import Machine
from winding_supervisor.processes.orchestrator import Orchestrator
from winding_supervisor.session.dashboard_process import DashboardProcess, outlive
from winding_supervisor.session.domain_lock import chosen_domain, domain_lock
from winding_supervisor.session.external_session import ExternalSession, NextRun
from winding_supervisor.session.interruption import Interruption, run_closing
from winding_supervisor.session.machine_run import MachineRun, View
from winding_supervisor.session.operator_run import (
    SESSION_ENDED,
    OperatedRun,
    OperatorRun,
    parameter_notes,
)
from winding_supervisor.session.run_config import RunConfig, RunResult, check_run, claim_folder
from winding_supervisor.session.run_parts import (
    TraceRecording,
    describe_machine,
    graph_config,
    new_machine,
    new_recorder,
    page_config,
)
from winding_supervisor.watch.event_log import EventLog
from winding_supervisor.watch.supervisor import Supervisor, replay_parameters

Report = Callable[[str], None]
Deliver = Callable[[RunResult], None]


@contextmanager
def opened_run(config: RunConfig) -> Iterator[Run]:
    """Check a run and yield it, with its domain locked and its folder made.

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
        yield Run(claimed)


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


class Run:
    """A run whose domain and folder are its own.

    Attributes:
        config: Of the run; its directory is the folder that was made.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config
        self._log = EventLog(file=config.directory / "events.jsonl")
        self._operated: OperatorRun | None = None
        self._events = self._bags = 0
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
            return await self._wind(stack, interruption, view, report, deliver or _drop)

        recorder = run_closing(work)
        if self._delivered or self._operated:
            return None
        if self.config.page is None:
            return self._result(recorder)
        return None if recorder.buffer.time <= 0.0 else self._result(recorder, SESSION_ENDED)

    def remains(self, reason: str) -> list[RunResult]:
        """Return what runs leave that ended early for a reason and were not delivered."""
        recorder = self._recorder_of_run
        if recorder is None or self._delivered:
            return []
        if self._operated is not None:
            runs = self._operated.remaining(reason)
            return [self._operated_result(recorder, run) for run in runs if run.buffer.time > 0.0]
        if self._following is None or not self._following.begun or recorder.buffer.time <= 0.0:
            return []
        return [self._result(recorder, reason)]

    def _result(self, recorder: Recorder, ended: str = "") -> RunResult:
        wall = 0.0 if self._following is None else self._following.wall_s
        return RunResult(
            buffer=recorder.buffer,
            wall_s=wall,
            recording_error=recorder.error,
            events=tuple(self._log.events[self._events :]),
            bags=recorder.bags.present(self._bags),
            ended=ended,
            limits=self._limits(),
            simulated=self.config.machine is None,
            trace=None if self._trace is None else self._trace.since(recorder.buffer.begun_ns),
        )

    def _limits(self) -> OperatorLimits | None:
        return None if self._dashboard is None else self._dashboard.limits

    def _operated_result(self, recorder: Recorder, run: OperatedRun) -> RunResult:
        events, self._events = self._log.events[self._events :], len(self._log.events)
        return RunResult(
            buffer=run.buffer,
            wall_s=run.wall_s,
            recording_error=recorder.error,
            events=tuple(events),
            wound=run.wound,
            bags=run.bags,
            ended=run.ended,
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
        stack.callback(client.close)
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
        orchestrator = Orchestrator(graph_config(config, axes), client)
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
        stack.push_async_callback(interruption.unless_hastened, machine.leave)
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
            await self._following.follow(view, ended.is_set, (supervisor.watch(),))
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
        )
        try:
            await self._conduct(session, view, report, deliver)
        except (GraphError, TimeoutError) as error:
            report(f"the session cannot go on: {error}; the page stays, Ctrl-C here ends it")
            await machine.leave()
            await orchestrator.stop()
            for result in self.remains(str(error)):
                await asyncio.to_thread(deliver, result)
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
            )
            await external.follow(
                partial(self._next, session.machine, session.recorder),
                view,
                partial(self._take_external, session.machine, session.recorder),
                partial(self._deliver_external, session.recorder, deliver, report),
                session.page.keep(),
            )
            return
        self._operated = OperatorRun(
            session.client,
            session.orchestrator,
            session.recorder,
            session.ended,
            lambda run: deliver(self._operated_result(session.recorder, run)),
            self._limits,
            self.config.parameters()[topics.RIG],
        )
        await self._operated.follow((session.supervisor.watch(), session.page.keep()), view)

    def _next(self, machine: ExternalMachine, recorder: Recorder) -> MachineRun:
        """Return what follows the next run of a machine that an operator conducts."""
        parameters = self.config.parameters(machine.parameters())
        recorder.bags.note(parameter_notes(parameters))
        self._delivered = False
        self._following = MachineRun(machine, recorder.buffer, operated=True)
        return self._following

    def _take_external(self, machine: ExternalMachine, recorder: Recorder) -> RunResult | None:
        """Return what a run that is over leaves; None where none has begun."""
        if recorder.buffer.time <= 0.0:
            return None
        ended = "" if machine.end is not None else "reset by the operator"
        return replace(self._result(recorder, ended), buffer=recorder.buffer.before())

    async def _deliver_external(
        self, recorder: Recorder, deliver: Deliver, report: Report, result: RunResult
    ) -> None:
        await asyncio.to_thread(deliver, result)
        self._delivered = True
        self._events, self._bags = len(self._log.events), len(recorder.bags.folders)
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
