"""One winding session: own the domain, bring the graph up, record, run, stop."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from cable_winding.parameters import build
from cable_winding.ros import topics
from winding_bringup.environment import clean_shared_memory, set_process_environment
from winding_bringup.graph import DEFAULT_NAMESPACE, GRAPH, pace_topics, parameters_of
from winding_bringup.orchestrator import GraphConfig, GraphError, Orchestrator
from winding_bringup.ownership import chosen_domain, owned
from winding_bringup.recorder import Recorder, RecorderError, Tape
from winding_bringup.ros_client import RosClient

_POLL = 0.05
_VIEW_PERIOD = 0.25


@dataclass(frozen=True, kw_only=True)
class SessionConfig:
    """One run of the graph.

    Attributes:
        directory: Folder of logs and of what the run leaves behind.
        condition: Parameters that every node shares (`ConditionParameters`).
        own: Node name -> parameters of that node alone.
        duration: Simulated length [s].
        bag: Where to record, or None.
        parameters_file: The user's own parameter file.
        domain: DDS domain, or None for the environment's.
        namespace: Namespace of the graph.
    """

    directory: Path
    condition: Mapping[str, object]
    own: Mapping[str, Mapping[str, object]]
    duration: float
    bag: Path | None = None
    parameters_file: Path | None = None
    domain: int | None = None
    namespace: str = DEFAULT_NAMESPACE


@dataclass(frozen=True, kw_only=True)
class SessionResult:
    """What a session leaves: the tape and how long it took."""

    tape: Tape
    wall_s: float


View = Callable[[Tape, float], None]


def check_session(config: SessionConfig) -> None:
    """Refuse what can be refused before any process starts.

    Raises:
        ParameterError: A node's parameter has an unknown name or a bad value.
        DomainError: The domain is not a domain.
        RecorderError: The bag exists already.
    """
    for spec in GRAPH:
        build(parameters_of(spec), _parameters(config)[spec.name], owner=spec.name)
    chosen_domain(config.domain)
    if config.bag is not None and config.bag.exists():
        raise RecorderError(f"{config.bag} exists already; a recording is never overwritten")


def run_session(config: SessionConfig, view: View) -> SessionResult:
    """Run the graph once from start to finish.

    Args:
        config: What to run.
        view: Called a few times per second with the tape so far and the wall time [s].

    Raises:
        ParameterError, RecorderError: As in `check_session`.
        DomainError: Domain and namespace are taken.
        GraphError: A node refused or died; what was recorded until then is kept.
    """
    check_session(config)
    domain = chosen_domain(config.domain)
    with owned(domain, config.namespace):
        set_process_environment(domain, config.directory / "log")
        clean_shared_memory()
        return asyncio.run(_run(config, view))


async def _run(config: SessionConfig, view: View) -> SessionResult:
    task = asyncio.current_task()
    assert task is not None
    # A terminated session stops its nodes and closes its bag, as an interrupted one does.
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    recorded = tuple(
        topic
        for topic in topics.TOPICS
        if topic.recorded and (config.bag is not None or topic not in _PICTURES)
    )
    client = RosClient(config.namespace)
    recorder = Recorder(client.node, config.bag, recorded=recorded)
    client.start()
    orchestrator = Orchestrator(
        GraphConfig(
            namespace=config.namespace,
            log_directory=config.directory / "log",
            parameters=_parameters(config),
            parameters_file=config.parameters_file,
            recorded=frozenset(topic.name for topic in recorded),
        ),
        client,
    )
    try:
        await orchestrator.start()
        await orchestrator.bring_up()
        begin = time.monotonic()
        await orchestrator.command("rig/start")
        await _follow(config, orchestrator, recorder, view, begin)
        wall = time.monotonic() - begin
    finally:
        await orchestrator.stop()
        client.close()
        recorder.close()
    return SessionResult(tape=recorder.tape, wall_s=wall)


_PICTURES = (topics.IMAGE, topics.PREVIEW)


def _parameters(config: SessionConfig) -> dict[str, dict[str, object]]:
    parameters = {
        spec.name: {**config.condition, **config.own.get(spec.name, {})} for spec in GRAPH
    }
    parameters[topics.RIG]["pace_topics"] = ",".join(topic.name for topic in pace_topics())
    return parameters


async def _follow(
    config: SessionConfig,
    orchestrator: Orchestrator,
    recorder: Recorder,
    view: View,
    begin: float,
) -> None:
    """Wait until every room has dealt with the run's last sample."""
    death = asyncio.create_task(orchestrator.first_death())
    shown = begin - _VIEW_PERIOD
    try:
        while not _complete(config, recorder.tape):
            if death.done():
                await death.result().stop()
                raise GraphError(
                    f"{orchestrator.obituary(death.result())} at "
                    f"{recorder.tape.last_stamp(topics.JOINT_STATES):.3f} s of simulated time"
                )
            if recorder.error is not None:
                raise GraphError(f"the recording failed: {recorder.error}")
            now = time.monotonic()
            if now - shown >= _VIEW_PERIOD:
                view(recorder.tape, now - begin)
                shown = now
            await asyncio.sleep(_POLL)
        view(recorder.tape, time.monotonic() - begin)
    finally:
        death.cancel()


def _complete(config: SessionConfig, tape: Tape) -> bool:
    """Return whether each room's last message of the run is on the tape."""
    return all(
        tape.last_stamp(topic) > config.duration - 1.0 / topic.rate
        for topic in (
            topics.JOINT_STATES,
            topics.CAMERA_INFO,
            topics.TRACKED_MARKERS,
            topics.FEM_MARKERS,
            topics.CORRECTED_MARKERS,
        )
        if topic.rate is not None
    )
