"""One run of the graph: own the domain, bring the nodes up, record, wind, close everything."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AsyncExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from winding_recorder.live.recorder import Recorder, RunBuffer
from winding_ros import topics
from winding_ros.async_client import AsyncClient
from winding_ros.environment import set_process_environment
from winding_ros.graph_error import GraphError
from winding_ros.topic import Topic
from winding_supervisor.completion import Completion
from winding_supervisor.dashboard_process import DashboardConfig, DashboardProcess
from winding_supervisor.domain_lock import chosen_domain, domain_lock
from winding_supervisor.event_log import Event, EventLog
from winding_supervisor.interruption import Interruption, run_closing
from winding_supervisor.operator_run import OperatorRun, parameter_notes
from winding_supervisor.orchestrator import GraphConfig, Orchestrator
from winding_supervisor.run_config import RunConfig, check_run, claim_folder
from winding_supervisor.supervision import Supervisor, replay_parameters

_POLL = 0.05
_VIEW_PERIOD = 0.25
_PICTURES = (topics.IMAGE, topics.PREVIEW)


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a run leaves.

    Attributes:
        buffer: Every message but the pictures.
        wall_s: How long the run took [s].
        recording_error: What ended the bag before the run, if anything did.
        events: What supervision saw and did; nothing in a run without failures.
        wound: Parameters of the machine in a run that an operator conducted; nothing when none
            was begun.
        bags: What was recorded.
    """

    buffer: RunBuffer
    wall_s: float
    recording_error: Exception | None = None
    events: tuple[Event, ...] = ()
    wound: Mapping[str, object] = field(default_factory=dict)
    bags: tuple[Path, ...] = ()


View = Callable[[RunBuffer, float], None]
Say = Callable[[str], None]


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


class Run:
    """A run whose domain and folder are its own.

    Attributes:
        config: Of the run; its directory is the folder that was made.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config
        self._log = EventLog(file=config.directory / "events.jsonl")
        self._wall = 0.0
        self._wound: Mapping[str, object] = {}

    def wind(self, view: View, say: Say = print) -> RunResult:
        """Run the graph once from start to finish, or as an operator conducts it.

        Args:
            view: Called a few times per second with the buffer so far and the wall time [s].
            say: Takes the sentence with the address of the operator's page.

        Raises:
            GraphError: A node refused or died; what was recorded until then is kept.
            KeyboardInterrupt: A signal ended the run; every process has ended, the bag is closed.
        """

        async def work(stack: AsyncExitStack, interruption: Interruption) -> Recorder:
            return await self._wind(stack, interruption, view, say)

        recorder = run_closing(work)
        return RunResult(
            buffer=recorder.buffer,
            wall_s=self._wall,
            recording_error=recorder.error,
            events=tuple(self._log.events),
            wound=self._wound,
            bags=tuple(recorder.bags.folders),
        )

    async def _wind(
        self, stack: AsyncExitStack, interruption: Interruption, view: View, say: Say
    ) -> Recorder:
        config = self.config
        client = AsyncClient(config.namespace)
        stack.callback(client.close)
        recorder = self._recorder(client)
        # It publishes until everything is stored, so it is closed before the client.
        stack.callback(recorder.close)
        client.start()
        orchestrator = Orchestrator(self._graph(), client)
        supervisor = Supervisor(
            orchestrator,
            client,
            recorder.buffer,
            self._log,
            {topics.FEM: lambda: self._replay(recorder.buffer)},
            operated=config.page is not None,
        )
        page: DashboardProcess | None = None
        if config.page is not None:
            page = self._page(config.page, client, supervisor)
            stack.push_async_callback(page.kill)
            stack.push_async_callback(interruption.unless_hastened, page.stop)
        stack.push_async_callback(orchestrator.kill)
        stack.push_async_callback(interruption.unless_hastened, orchestrator.stop)
        await orchestrator.start()
        await orchestrator.bring_up()
        await stack.enter_async_context(supervisor.beating())
        if page is None:
            await self._follow(orchestrator, supervisor, recorder, view)
            return recorder
        await page.start()
        say(f"operator's page: {page.url}  (Start is there; Ctrl-C here ends the run)")
        ended = asyncio.Event()
        interruption.instead_of_sigint(ended.set)
        operated = OperatorRun(client, orchestrator, recorder, ended)
        await operated.follow((supervisor.watch(), page.keep()), view)
        self._wound, self._wall = operated.wound, operated.wall_s
        return recorder

    async def _follow(
        self, orchestrator: Orchestrator, supervisor: Supervisor, recorder: Recorder, view: View
    ) -> None:
        """Start the machine and wait until every node has dealt with the run's last sample."""
        begin = time.monotonic()
        await orchestrator.command("rig/start")
        supervision = asyncio.create_task(supervisor.watch())
        ending = Completion(self.config.duration)
        shown = begin - _VIEW_PERIOD
        try:
            while not ending.reached(recorder.buffer, time.monotonic()):
                if supervision.done():
                    supervision.result()
                now = time.monotonic()
                if now - shown >= _VIEW_PERIOD:
                    view(recorder.buffer, now - begin)
                    shown = now
                await asyncio.sleep(_POLL)
            view(recorder.buffer, time.monotonic() - begin)
        finally:
            supervision.cancel()
        self._wall = time.monotonic() - begin

    def _recorder(self, client: AsyncClient) -> Recorder:
        """Return the recorder; an operator's takes pictures only while a bag is asked for."""
        config = self.config
        further: dict[str, Any] = {}
        if config.page is not None:
            further = {
                "further": config.bag or config.directory / "bag",
                "on_demand": _PICTURES,
            }
        return Recorder(
            client.node,
            config.bag,
            recorded=self._recorded(),
            config=config.recording,
            notes=parameter_notes(config.parameters()),
            **further,
        )

    def _recorded(self) -> tuple[Topic, ...]:
        throughout = self.config.bag is not None and self.config.page is None
        return tuple(
            topic
            for topic in topics.TOPICS
            if topic.recorded and (throughout or topic not in _PICTURES)
        )

    def _graph(self) -> GraphConfig:
        config = self.config
        return GraphConfig(
            namespace=config.namespace,
            log_directory=config.log_directory,
            parameters=config.own_parameters(),
            parameters_file=config.parameters_file,
            recorded=frozenset(topic.name for topic in self._recorded()),
            attach=config.attach,
        )

    def _page(
        self, parameters: Mapping[str, object], client: AsyncClient, supervisor: Supervisor
    ) -> DashboardProcess:
        page = DashboardConfig(
            parameters=parameters,
            namespace=self.config.namespace,
            log_directory=self.config.log_directory,
        )
        return DashboardProcess(page, client, self._log, lambda: supervisor.t)

    def _replay(self, buffer: RunBuffer) -> dict[str, object]:
        """Return the parameters with which a restarted model winds up the run's inputs so far."""
        if self.config.attach:
            raise GraphError(
                f"{topics.FEM} was lost and runs elsewhere, where it cannot replay the run's inputs"
            )
        return replay_parameters(buffer, self.config.log_directory / f"{topics.FEM}_inputs.npy")
