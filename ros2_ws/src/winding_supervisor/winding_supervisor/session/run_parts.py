"""The parts of a configured run: recorder, machine, graph, page, URDF, trace."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import String

from winding_core.arm.opening import open_arm
from winding_core.parameters import build
from winding_core.run_options import CameraPlacement
from winding_core.trace import TRACE_DTYPE, usable_records
from winding_core.urdf import CarriageLimits, machine_urdf
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.live.recorder import Recorder, RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import FEM, LAY_CONTROL, RIG, TRACKER, parameters_of
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.serialised import MessageError
from winding_ros.topic import Topic
from winding_ros.topics import ROBOT_DESCRIPTION
from winding_supervisor.machines.external_machine import ExternalMachine
from winding_supervisor.machines.machine import Machine
from winding_supervisor.machines.simulated_machine import SimulatedMachine
from winding_supervisor.processes.orchestrator import GraphConfig
from winding_supervisor.session.dashboard_process import DashboardConfig
from winding_supervisor.session.run_config import Axes, RunConfig, parameter_notes

_PICTURES = (topics.IMAGE, topics.PREVIEW)


def new_recorder(config: RunConfig, client: AsyncClient) -> Recorder:
    """Return the recorder; an operator's takes pictures only while a bag is asked for."""
    bag, operated = config.spec.path("bag"), config.page is not None
    stored = config.spec.recording
    return Recorder(
        client.node,
        bag,
        recorded=_recorded(config),
        config=BagConfig(compression=stored.compression, split_bytes=round(stored.split)),
        notes={**config.notes, **parameter_notes(config.parameters())},
        further=(bag or config.directory / "bag") if operated else None,
        on_demand=_PICTURES if operated else (),
    )


def new_machine(config: RunConfig, client: AsyncClient, buffer: RunBuffer) -> Machine:
    """Return what is known of the machine, simulated or behind a driver of its own."""
    if config.machine is None:
        return SimulatedMachine(client, buffer, config.spec.condition.duration)
    return ExternalMachine(config.machine, client, buffer)


def graph_config(config: RunConfig, axes: Axes) -> GraphConfig:
    """Return what the graph's processes are run with."""
    return GraphConfig(
        namespace=config.spec.graph.namespace,
        log_directory=config.log_directory,
        parameters=config.own_parameters(axes),
        parameters_file=config.spec.path("parameters"),
        recorded=frozenset(topic.name for topic in _recorded(config)),
        attach=config.spec.graph.attach,
        graph=config.graph,
        sim_time=config.machine is None,
    )


def page_config(config: RunConfig, axes: Axes) -> DashboardConfig | None:
    """Return how the operator's page is served; None for a run without one."""
    if config.page is None:
        return None
    return DashboardConfig(
        parameters={
            **config.page,
            **axes,
            "runs": str(config.listed_runs),
            "nodes": ",".join(spec.name for spec in config.graph),
        },
        namespace=config.spec.graph.namespace,
        log_directory=config.log_directory,
    )


def _recorded(config: RunConfig) -> tuple[Topic, ...]:
    throughout = config.spec.path("bag") is not None and config.page is None
    return tuple(
        topic
        for topic in topics.TOPICS
        if topic.recorded and (throughout or topic not in _PICTURES)
    )


def describe_machine(
    config: RunConfig, axes: Axes, node: Node, report: Callable[[str], None]
) -> None:
    """Publish robot_description, latched, from the condition that the nodes are run with.

    Args:
        config: The run.
        axes: As its nodes read them.
        node: Publishes it for as long as it lives.
        report: Takes the sentence when the machine has no URDF.
    """
    names = {spec.name for spec in config.graph}
    spec = TRACKER if TRACKER.name in names else FEM
    configured = config.parameters(axes)
    wound: Any = build(parameters_of(spec), configured[spec.name], owner=spec.name)
    try:
        camera = wound if isinstance(wound, CameraPlacement) else None
        what = wound.resolved()
        arm = open_arm(config.spec.machine.machine_file, what)
        limits = _carriage_limits(config, configured)
        urdf = machine_urdf(what, wound, camera, limits, arm)
    except ValueError as error:
        report(f"no {ROBOT_DESCRIPTION.name}: {error}")
        return
    ROBOT_DESCRIPTION.advertise(node).publish(String(data=urdf))


def _carriage_limits(
    config: RunConfig, configured: Mapping[str, Mapping[str, object]]
) -> CarriageLimits | None:
    """Return what the machine, or else the controller of the lay, allows the carriage."""
    for node, travel, speed in (
        (RIG, "carriage_travel", "carriage_speed_limit"),
        (LAY_CONTROL, "guide_travel", "guide_speed_limit"),
    ):
        spec = next((item for item in config.graph if item.name == node.name), None)
        if spec is not None:
            limits: Any = build(parameters_of(spec), configured[spec.name], owner=spec.name)
            low, high = getattr(limits, travel)
            return CarriageLimits(low=low, high=high, speed=getattr(limits, speed))
    return None


class TraceRecording:
    """Records the traces of the nodes, which trace only while the topic has a subscriber.

    Args:
        node: Spun elsewhere.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._parts: list[NDArray[np.void]] = []
        topics.TRACE.subscribe(node, self._take, raw=True)

    def since(self, begin_ns: int) -> NDArray[np.void]:
        """Return what was noted since a monotonic wall time [ns]: TRACE_DTYPE, shape (n,)."""
        records = np.concatenate([np.zeros(0, TRACE_DTYPE), *self._parts])
        # Nodes note by the system's clock.
        begin = 1e-9 * (begin_ns + time.time_ns() - time.monotonic_ns())
        return records[records["ended"] >= begin]

    def _take(self, data: bytes) -> None:
        try:
            records = decode_cloud(data, TRACE_DTYPE)[1]
        except MessageError as error:
            self._node.get_logger().warning(f"{topics.TRACE.name}: {error}")
            return
        usable = usable_records(records)
        if not usable.all():
            self._node.get_logger().warning(
                f"{topics.TRACE.name}: {np.count_nonzero(~usable)} records are unusable"
            )
        self._parts.append(records[usable])
