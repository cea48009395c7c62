"""What a run is put together of, as its configuration says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from winding_recorder.live.recorder import Recorder, RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.topic import Topic
from winding_supervisor.dashboard_process import DashboardConfig
from winding_supervisor.external_machine import ExternalMachine
from winding_supervisor.machine import Machine
from winding_supervisor.operator_run import parameter_notes
from winding_supervisor.orchestrator import GraphConfig
from winding_supervisor.run_config import RunConfig
from winding_supervisor.simulated_machine import SimulatedMachine

_PICTURES = (topics.IMAGE, topics.PREVIEW)


def new_recorder(config: RunConfig, client: AsyncClient) -> Recorder:
    """Return the recorder; an operator's takes pictures only while a bag is asked for."""
    further: dict[str, Any] = {}
    if config.page is not None:
        further = {
            "further": config.bag or config.directory / "bag",
            "on_demand": _PICTURES,
        }
    return Recorder(
        client.node,
        config.bag,
        recorded=_recorded(config),
        config=config.recording,
        notes={**config.notes, **parameter_notes(config.parameters())},
        **further,
    )


def new_machine(config: RunConfig, client: AsyncClient, buffer: RunBuffer) -> Machine:
    """Return what is known of the machine, simulated or behind a driver of its own."""
    if config.machine is None:
        return SimulatedMachine(client, buffer, config.duration)
    return ExternalMachine(config.machine, client, buffer)


def graph_config(config: RunConfig, axes: Mapping[str, object]) -> GraphConfig:
    """Return what the graph's processes are run with.

    Args:
        config: Of the run.
        axes: Parameters of those nodes that read the machine's axes.
    """
    return GraphConfig(
        namespace=config.namespace,
        log_directory=config.log_directory,
        parameters=config.own_parameters(axes),
        parameters_file=config.parameters_file,
        recorded=frozenset(topic.name for topic in _recorded(config)),
        attach=config.attach,
        graph=config.graph,
        sim_time=config.machine is None,
    )


def page_config(config: RunConfig, axes: Mapping[str, object]) -> DashboardConfig | None:
    """Return how the operator's page is served; None for a run without one.

    Args:
        config: Of the run.
        axes: Parameters of those nodes that read the machine's axes.
    """
    if config.page is None:
        return None
    return DashboardConfig(
        parameters={
            **config.page,
            **axes,
            "runs": str(config.listed_runs),
            "nodes": ",".join(spec.name for spec in config.graph),
        },
        namespace=config.namespace,
        log_directory=config.log_directory,
    )


def _recorded(config: RunConfig) -> tuple[Topic, ...]:
    throughout = config.bag is not None and config.page is None
    return tuple(
        topic
        for topic in topics.TOPICS
        if topic.recorded and (throughout or topic not in _PICTURES)
    )
