"""One run of the graph: own the domain, bring the nodes up, record, wind, close everything."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, contextmanager, suppress
from dataclasses import replace
from functools import partial

import numpy as np

from winding_core.machine.commands import TensionCommand
from winding_core.run_outcome import Cause, EndedBy, RunOutcome
from winding_recorder.live.recorder import Recorder
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.environment import set_process_environment
from winding_ros.graph import GraphError, Policy
from winding_ros.messages.commands import encode_tension_command
from winding_supervisor.machines.external_machine import ExternalMachine, MachineError
from winding_supervisor.processes.orchestrator import Orchestrator
from winding_supervisor.session.conduct import Conduct, NextRun
from winding_supervisor.session.dashboard_process import DashboardProcess, outlive
from winding_supervisor.session.domain_lock import chosen_domain, domain_lock
from winding_supervisor.session.interruption import Interruption, ended_if_stuck, run_closing
from winding_supervisor.session.participants import Participants
from winding_supervisor.session.rest import Rest
from winding_supervisor.session.rig_conduct import RigConduct
from winding_supervisor.session.run_config import (
    RunConfig,
    check_run,
    claim_folder,
    parameter_notes,
)
from winding_supervisor.session.run_parts import (
    TraceRecording,
    describe_machine,
    graph_config,
    new_machine,
    new_recorder,
    page_config,
)
from winding_supervisor.session.session import RunResult, Session, View
from winding_supervisor.watch.event_log import EventLog
from winding_supervisor.watch.supervisor import RunEndedError, Supervisor, replay_parameters

# Corners of a programme: cylinder angle [rad] and pull [N].
Corner = tuple[float, float]
_PERIOD = 0.04
_WINDING = 1.0e-3  # A machine takes commands once it winds
_DISCOVERY = 10.0  # A driver's subscription is discovered within so long [s]


class PullProgramme:
    """Publishes rig/tension_command as the cylinder turns.

    Args:
        client: Its node publishes.
        buffer: Has the newest encoder samples.
        corners: At ascending angles, straight lines between; at least one.
    """

    def __init__(self, client: AsyncClient, buffer: RunBuffer, corners: Sequence[Corner]) -> None:
        self._buffer = buffer
        self._angles, self._pulls = (list(column) for column in zip(*corners, strict=True))
        self._publisher = topics.TENSION_COMMAND.advertise(client.node)

    async def taken(self) -> None:
        """Wait until the machine listens.

        Raises:
            GraphError: It does not.
        """
        waited = 0.0
        while not self._publisher.get_subscription_count():
            if waited >= _DISCOVERY:
                raise GraphError("the machine does not take rig/tension_command: it has no brake")
            await asyncio.sleep(_PERIOD)
            waited += _PERIOD

    @asynccontextmanager
    async def followed(self) -> AsyncIterator[None]:
        """Command the pull while the body runs."""
        task = asyncio.create_task(self._follow())
        try:
            yield
        finally:
            task.cancel()
            # What ended it before is an error of the run.
            with suppress(asyncio.CancelledError):
                await task

    async def _follow(self) -> None:
        while True:
            newest = self._buffer.newest_axis_reading()
            if newest is not None and newest[1].cylinder_angle > _WINDING:
                pull = float(np.interp(newest[1].cylinder_angle, self._angles, self._pulls))
                self._publisher.publish(encode_tension_command(TensionCommand(t=0.0, force=pull)))
            await asyncio.sleep(_PERIOD)


Report = Callable[[str], None]
Deliver = Callable[[RunResult], RunOutcome | None]

# A machine that does not stop is asked for so long where no operator is present [s].
_UNATTENDED = 10.0
_CLOSING = 20.0  # The middleware has so long to close; Fast DDS has been seen in a deadlock [s]


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
    domain = chosen_domain(config.spec.domain)
    with domain_lock(domain, config.spec.graph.namespace):
        claimed = replace(config, directory=claim_folder(config))
        set_process_environment(domain, claimed.log_directory)
        run = Run(claimed)
        try:
            yield run
        finally:
            with ended_if_stuck(_CLOSING, claimed.directory / "closing.txt"):
                run.middleware.close()


class Run:
    """A run, or a session of runs, whose domain and folder are its own."""

    def __init__(self, config: RunConfig) -> None:
        self.config = config  # Of the run; its directory is the folder that was made
        self.middleware = ExitStack()  # What is left to close when everything is written
        self._log = EventLog(file=config.directory / "events.jsonl")
        self._recorder: Recorder | None = None
        self._session: Session | None = None

    def wind(self, view: View, report: Report, deliver: Deliver) -> None:
        """Run the graph once from start to finish, or as an operator conducts it.

        Args:
            view: Called a few times per second with the buffer so far and the wall time [s].
            report: Takes the sentence with the address of the operator's page.
            deliver: Takes every run of an operator but the last as soon as it is over, in a thread
                of its own.

        Raises:
            GraphError: A node refused or died; what was recorded until then is kept.
            KeyboardInterrupt: A signal ended the run; every process has ended, the bag is closed.
        """

        async def work(stack: AsyncExitStack, interruption: Interruption) -> None:
            try:
                await self._wind(stack, interruption, view, report, deliver)
            except RunEndedError:
                raise
            except asyncio.CancelledError:
                self._end(EndedBy.SIGNAL, interruption.signal, f"{interruption.signal} came")
                raise
            except (GraphError, TimeoutError, OSError) as error:
                self._fail(error)
                raise

        run_closing(work)

    def remains(self) -> list[RunResult]:
        """Return, once, what runs leave that were not delivered."""
        return [] if self._session is None else self._session.remains()

    def _fail(self, error: Exception) -> None:
        if isinstance(error, MachineError):
            self._end(EndedBy.MACHINE, topics.RIG, str(error))
        else:
            self._end(EndedBy.FAULT, topics.ORCHESTRATOR, str(error))

    def _end(self, by: EndedBy, source: str, text: str) -> None:
        t = None if self._recorder is None else self._recorder.buffer.time
        self._log.end(Cause(by=by, source=source, text=text, t=t))

    async def _wind(
        self,
        stack: AsyncExitStack,
        interruption: Interruption,
        view: View,
        report: Report,
        deliver: Deliver,
    ) -> None:
        config, log = self.config, self._log
        client = AsyncClient(config.spec.graph.namespace)
        self.middleware.callback(client.close)
        recorder = self._recorder = new_recorder(config, client)
        # It publishes until everything is stored, so it is closed before the client.
        stack.callback(recorder.close)
        trace = TraceRecording(client.node) if config.spec.recording.trace else None
        client.start()
        machine = new_machine(config, client, recorder.buffer)
        await machine.stand()
        axes = machine.parameters()
        describe_machine(config, axes, client.node, report)

        def note_parameters() -> None:
            recorder.bags.note(parameter_notes(config.parameters(machine.parameters())))

        if axes:
            note_parameters()
        orchestrator = Orchestrator(graph_config(config, axes), client, report)
        supervisor = Supervisor(
            orchestrator,
            machine,
            client,
            recorder.buffer,
            log,
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
            page = DashboardProcess(served, client, log, lambda: machine.t)
            stack.push_async_callback(page.kill)
            stack.push_async_callback(interruption.unless_hastened, page.stop)
        stack.push_async_callback(orchestrator.kill)
        stack.push_async_callback(interruption.unless_hastened, orchestrator.stop)
        rest = Rest(machine, log, client, report)
        leave = partial(self._leave, rest, interruption)
        stack.push_async_callback(interruption.unless_hastened, leave)
        await orchestrator.start()
        await orchestrator.bring_up()
        await stack.enter_async_context(supervisor.beating())
        # Before the page: what it offers may be pressed as soon as it is served.
        await machine.ready()
        if config.pulls:
            pulls = PullProgramme(client, recorder.buffer, config.pulls)
            await pulls.taken()
            await stack.enter_async_context(pulls.followed())
        if page is not None:
            await page.start()
            report(
                f"operator's page: {page.config.url}  (Start is there; Ctrl-C here ends the run)"
            )
        if not machine.simulated:
            report(f"ready; Ctrl-C ends the {'run' if page is None else 'session'}")
        who = Participants(
            client=client,
            recorder=recorder,
            machine=machine,
            orchestrator=orchestrator,
            supervisor=supervisor,
            log=log,
            rest=rest,
            page=page,
            trace=trace,
            report=report,
        )
        conduct = self._conduct(who)
        session = self._session = Session(who, conduct, deliver, note_parameters)
        if conduct.operated or not machine.simulated:
            interruption.instead_of_sigint(session.ended.set)
        try:
            await session.follow(view)
        except (GraphError, TimeoutError) as error:
            if page is None:
                raise
            if not isinstance(error, RunEndedError):
                self._fail(error)
            report(f"the session cannot go on: {error}; the page stays, Ctrl-C here ends it")
            await rest.bring()
            await orchestrator.stop()
            for result in self.remains():
                session.publish_outcome(await asyncio.to_thread(deliver, result))
            await outlive(str(error), page, client, session.ended)
            raise

    def _conduct(self, who: Participants) -> Conduct:
        """Return how runs begin: here, or as an operator of either kind of machine wants."""
        config, machine = self.config, who.machine
        if config.page is None:
            return Conduct(who)
        if not isinstance(machine, ExternalMachine):
            return RigConduct(who, config.parameters()[topics.RIG])
        return NextRun(who, machine, lambda: config.own_parameters(machine.parameters()))

    async def _leave(self, rest: Rest, interruption: Interruption) -> None:
        """Leave the machine at rest; what may still move is stayed at."""
        if not await rest.bring():
            return
        interruption.instead_of_sigint(rest.confirmed.set)
        attended = self.config.page is not None or self.config.attended
        await rest.hold(math.inf if attended else _UNATTENDED)

    def _replay(self, buffer: RunBuffer, name: str) -> dict[str, object]:
        """Return the parameters with which a restarted node takes up the run."""
        if not self.config.spec.graph.attach:
            return replay_parameters(buffer, self.config.log_directory / f"{name}_inputs.npy")
        if name == topics.FEM:
            raise GraphError(
                f"{name} was lost and runs elsewhere, where it cannot replay the run's inputs"
            )
        return {}
