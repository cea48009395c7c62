"""One winding session: own the domain, bring the graph up, record, run, stop."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from winding_core.parameters import build
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.live.recorder import Recorder, RecorderError, RunBuffer
from winding_ros import topics
from winding_ros.async_client import AsyncClient
from winding_ros.environment import set_process_environment
from winding_ros.graph import DEFAULT_NAMESPACE, GRAPH, PAGE, pace_topics, parameters_of
from winding_ros.parameter_files import parameters_for
from winding_supervisor.completion import Completion
from winding_supervisor.dashboard_process import DashboardConfig, DashboardProcess
from winding_supervisor.domain_lock import chosen_domain, domain_lock
from winding_supervisor.event_log import Event, EventLog
from winding_supervisor.graph_error import GraphError
from winding_supervisor.operator_run import OperatorRun, parameter_notes
from winding_supervisor.orchestrator import GraphConfig, Orchestrator
from winding_supervisor.supervision import Supervisor, replay_parameters

_POLL = 0.05
_VIEW_PERIOD = 0.25
# The machine stops when the orchestrator has given no sign of life for so long.
_SUPERVISOR_TIMEOUT = 1.5


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """One run of the graph.

    Attributes:
        directory: Folder of logs and of what the run leaves behind.
        condition: Parameters that every node shares (`Condition`).
        own: Node name -> parameters of that node alone.
        duration: Simulated length [s].
        bag: Where to record, or None.
        recording: How the bag is stored.
        parameters_file: The user's own parameter file.
        domain: DDS domain, or None for the environment's.
        namespace: Namespace of the graph.
        attach: Whether somebody else runs the nodes; nothing is started or ended here.
        page: Parameters of the operator's page; None for a run that starts by itself.
    """

    directory: Path
    condition: Mapping[str, object]
    own: Mapping[str, Mapping[str, object]]
    duration: float
    bag: Path | None = None
    recording: BagConfig = field(default_factory=BagConfig)
    parameters_file: Path | None = None
    domain: int | None = None
    namespace: str = DEFAULT_NAMESPACE
    attach: bool = False
    page: Mapping[str, object] | None = None


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a session leaves.

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
Tell = Callable[[str], None]


def check_run(config: RunConfig) -> None:
    """Refuse what can be refused before any process starts.

    Raises:
        ParameterError: A node's parameter has an unknown name or a bad value.
        DomainError: The domain is not a domain.
        RecorderError: The bag exists already.
    """
    for spec in GRAPH:
        build(parameters_of(spec), _parameters(config)[spec.name], owner=spec.name)
    chosen_domain(config.domain)
    if config.page is not None:
        build(parameters_of(PAGE), config.page, owner=PAGE.name).check()
    if config.bag is not None and config.bag.exists():
        raise RecorderError(f"{config.bag} exists already; a recording is never overwritten")


def run_graph(config: RunConfig, view: View, tell: Tell = print) -> RunResult:
    """Run the graph once from start to finish, or as an operator conducts it.

    Args:
        config: What to run.
        view: Called a few times per second with the buffer so far and the wall time [s].
        tell: Takes the sentence that says where the operator's page is.

    Raises:
        ParameterError, RecorderError: As in `check_run`.
        DomainError: Domain and namespace are taken.
        GraphError: A node refused or died; what was recorded until then is kept.
    """
    check_run(config)
    domain = chosen_domain(config.domain)
    with domain_lock(domain, config.namespace):
        set_process_environment(domain, config.directory / "log")
        return asyncio.run(_run(config, view, tell))


async def _run(config: RunConfig, view: View, tell: Tell) -> RunResult:
    log = EventLog(file=config.directory / "events.jsonl")
    task = asyncio.current_task()
    assert task is not None
    # A terminated session stops its nodes and closes its bag, as an interrupted one does.
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    recorded = tuple(
        topic
        for topic in topics.TOPICS
        if topic.recorded and (_records(config) or topic not in _PICTURES)
    )
    client = AsyncClient(config.namespace)
    recorder = Recorder(
        client.node,
        config.bag,
        recorded=recorded,
        config=config.recording,
        notes=_run_notes(config),
        **_further(config),
    )
    client.start()
    orchestrator = Orchestrator(
        GraphConfig(
            namespace=config.namespace,
            log_directory=config.directory / "log",
            parameters=_parameters(config),
            parameters_file=config.parameters_file,
            recorded=frozenset(topic.name for topic in recorded),
            attach=config.attach,
        ),
        client,
    )
    history = config.directory / "log" / f"{topics.FEM}_inputs.npy"
    supervisor = Supervisor(
        orchestrator,
        client,
        recorder.buffer,
        log,
        {topics.FEM: partial(_replay, config, recorder.buffer, history)},
        operated=config.page is not None,
    )
    wound: Mapping[str, object] = {}
    keeper: DashboardProcess | None = None
    try:
        await orchestrator.start()
        await orchestrator.bring_up()
        async with supervisor.beating():
            if config.page is not None:
                keeper = _page(config, config.page, client, log, supervisor)
                await keeper.start()
                tell(f"operator's page: {keeper.url}  (Start is there; Ctrl-C here ends the run)")
                operated = OperatorRun(client, orchestrator, recorder, _interrupted())
                await operated.follow((supervisor.watch(), keeper.keep()), view)
                wound, wall = operated.wound, operated.wall_s
            else:
                begin = time.monotonic()
                await orchestrator.command("rig/start")
                await _follow(config, supervisor, recorder, view, begin)
                wall = time.monotonic() - begin
    finally:
        await orchestrator.stop()
        if keeper is not None:
            await keeper.stop()
        # The recorder publishes until everything is stored.
        recorder.close()
        client.close()
    return RunResult(
        buffer=recorder.buffer,
        wall_s=wall,
        recording_error=recorder.error,
        events=tuple(log.events),
        wound=wound,
        bags=tuple(recorder.bags.folders),
    )


def _page(
    config: RunConfig,
    parameters: Mapping[str, object],
    client: AsyncClient,
    log: EventLog,
    supervisor: Supervisor,
) -> DashboardProcess:
    page = DashboardConfig(
        parameters=parameters,
        namespace=config.namespace,
        log_directory=config.directory / "log",
    )
    return DashboardProcess(page, client, log, lambda: supervisor.t)


def _interrupted() -> asyncio.Event:
    """Return what Ctrl-C sets from now on: it ends an operator's run and is no failure."""
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, ended.set)
    return ended


def _records(config: RunConfig) -> bool:
    """Return whether pictures are recorded throughout; an operator's recorder comes and goes."""
    return config.bag is not None and config.page is None


def _further(config: RunConfig) -> dict[str, Any]:
    """Return what lets an operator record; a run that starts by itself has one bag or none."""
    if config.page is None:
        return {}
    return {"further": config.bag or config.directory / "bag", "on_demand": _PICTURES}


def _replay(config: RunConfig, buffer: RunBuffer, file: Path) -> dict[str, object]:
    """Return the parameters with which a restarted model winds up what the run has had so far."""
    if config.attach:
        raise GraphError(
            f"{topics.FEM} was lost and runs elsewhere, where it cannot replay the run's inputs"
        )
    return replay_parameters(buffer, file)


_PICTURES = (topics.IMAGE, topics.PREVIEW)


def _run_notes(config: RunConfig) -> dict[str, str]:
    """Return the parameters of every node as a bag keeps them, for its replay."""
    stated = {}
    for name, own in _parameters(config).items():
        values: dict[str, object] = {}
        if config.parameters_file is not None:
            values |= parameters_for(config.parameters_file, f"/{config.namespace}/{name}")
        stated[name] = values | own
    return parameter_notes(stated)


def _parameters(config: RunConfig) -> dict[str, dict[str, object]]:
    parameters = {
        spec.name: {**config.condition, **config.own.get(spec.name, {})} for spec in GRAPH
    }
    parameters[topics.RIG]["pace_topics"] = ",".join(topic.name for topic in pace_topics())
    parameters[topics.RIG]["supervisor_timeout"] = _SUPERVISOR_TIMEOUT
    return parameters


async def _follow(
    config: RunConfig,
    supervisor: Supervisor,
    recorder: Recorder,
    view: View,
    begin: float,
) -> None:
    """Wait until every room has dealt with the run's last sample, under supervision."""
    supervision = asyncio.create_task(supervisor.watch())
    ending = Completion(config.duration)
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
