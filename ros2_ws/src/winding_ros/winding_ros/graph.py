"""The graph as data: which nodes there are, what they publish, and who listens."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from enum import Enum

from winding_ros import topics
from winding_ros.topics import Topic

DEFAULT_NAMESPACE = "winding"


class Policy(Enum):
    """What becomes of a run in which a node died or hangs; the machine is stopped first."""

    END = "the run ends"
    RESTART = "the node is started again and the run resumes"
    REPLAY = "the node is started again, replays the run's inputs, and the run resumes"
    ASIDE = "the node is started again and the machine goes on meanwhile"


@dataclass(frozen=True, kw_only=True)
class NodeSpec:
    """One node of the graph.

    Attributes:
        name: Node name.
        package: Python package; `python -m package` is the node's process.
        node_class: Class in `package.node` for composition in one process.
        parameters_class: Class in `package.ros.parameters` that states its parameters.
        publishes: Topics it publishes, /diagnostics aside.
        subscribes: Topics it listens to.
        policy: What becomes of the run when the node fails.
        answer: Topic whose stamps say how far the node has come; it holds simulated time.
    """

    name: str
    package: str
    node_class: str
    parameters_class: str
    publishes: tuple[Topic, ...]
    subscribes: tuple[Topic, ...]
    policy: Policy = Policy.END
    answer: Topic | None = None


# Sinks first, the rig last: who listens is awake before anybody speaks.
GRAPH: tuple[NodeSpec, ...] = (
    NodeSpec(
        name=topics.CORRECTION,
        package="correction_node",
        node_class="CorrectionNode",
        parameters_class="CorrectionParameters",
        publishes=(topics.CORRECTED_MARKERS, topics.CORRECTION_CASE),
        subscribes=(topics.FEM_MARKERS, topics.TRACKED_MARKERS),
        policy=Policy.RESTART,
        answer=topics.CORRECTED_MARKERS,
    ),
    NodeSpec(
        name=topics.FEM,
        package="cable_fem_node",
        node_class="CableFemNode",
        parameters_class="FemParameters",
        publishes=(
            topics.FEM_MARKERS,
            topics.FEM_CABLE,
            topics.FEM_CABLE_LINE,
            topics.FEM_PREDICTION,
            topics.FEM_MATERIAL,
        ),
        subscribes=(topics.JOINT_STATES, topics.TENSION, topics.TRACKED_MARKERS),
        policy=Policy.REPLAY,
        answer=topics.FEM_MARKERS,
    ),
    NodeSpec(
        name=topics.TRACKER,
        package="marker_tracker_node",
        node_class="MarkerTrackerNode",
        parameters_class="TrackerParameters",
        publishes=(topics.TRACKED_MARKERS,),
        subscribes=(topics.IMAGE, topics.CAMERA_INFO, topics.JOINT_STATES),
        policy=Policy.RESTART,
        answer=topics.TRACKED_MARKERS,
    ),
    NodeSpec(
        name=topics.RIG,
        package="winding_rig_node",
        node_class="RigNode",
        parameters_class="RigParameters",
        publishes=(
            topics.CLOCK,
            topics.JOINT_STATES,
            topics.JOINT_COMMANDS,
            topics.TENSION,
            topics.IMAGE,
            topics.CAMERA_INFO,
            topics.PREVIEW,
        ),
        subscribes=(
            topics.TRACKED_MARKERS,
            topics.FEM_MARKERS,
            topics.CORRECTED_MARKERS,
            topics.RECORDER_PROGRESS,
        ),
    ),
)


# No part of the graph: it looks and asks, and the graph is whole without it.
PAGE = NodeSpec(
    name=topics.DASHBOARD,
    package="winding_dashboard",
    node_class="DashboardNode",
    parameters_class="DashboardParameters",
    publishes=(),
    subscribes=tuple(
        topic
        for topic in topics.TOPICS
        if topic not in (topics.CLOCK, topics.IMAGE, topics.RECORDER_PROGRESS)
    ),
    policy=Policy.ASIDE,
)


def parameters_of(spec: NodeSpec) -> type:
    """Return the dataclass that states a node's parameters; importing it needs no ROS."""
    module = importlib.import_module(f"{spec.package}.ros.parameters")
    stated: type = getattr(module, spec.parameters_class)
    return stated


def pace_topics(graph: tuple[NodeSpec, ...] = GRAPH) -> tuple[Topic, ...]:
    """Return the topics whose stamps hold simulated time back, the recorder's included."""
    answers = tuple(spec.answer for spec in graph if spec.answer is not None)
    return (*answers, topics.RECORDER_PROGRESS)


def expected_subscribers(
    recorded: frozenset[str], graph: tuple[NodeSpec, ...] = GRAPH
) -> dict[str, dict[str, int]]:
    """Return how many subscriptions each node's publishers must match before time starts.

    Args:
        recorded: Names of the topics that the recorder listens to.
        graph: The nodes.

    Returns:
        Node name -> topic name -> count of subscriptions inside the graph.
    """
    return {
        spec.name: {
            topic.name: sum(topic in other.subscribes for other in graph)
            + (topic.name in recorded)
            # /clock also drives the node clock of everybody but the rig that owns it.
            + (len(graph) - 1 if topic is topics.CLOCK else 0)
            for topic in spec.publishes
        }
        for spec in graph
    }


def as_text(graph: tuple[NodeSpec, ...] = GRAPH) -> str:
    """Return the graph as lines `publisher -> topic [type, rate] -> listeners`."""
    lines = []
    for spec in reversed(graph):
        lines.append(f"{spec.name}  (python -m {spec.package})")
        for topic in spec.publishes:
            rate = "on change" if topic.rate is None else f"{topic.rate:g} Hz"
            heard = [other.name for other in graph if topic in other.subscribes]
            if topic is topics.CLOCK:
                heard = ["every node"]
            lines.append(
                f"  {topic.name}  [{topic.type_name}, {rate}]"
                + (f"  -> {', '.join(heard)}" if heard else "")
            )
    return "\n".join(lines)


def as_mermaid(graph: tuple[NodeSpec, ...] = GRAPH) -> str:
    """Return the graph as a Mermaid flowchart: one arrow per publisher, topic and listener."""
    lines = ["flowchart LR"]
    lines += [f"  {spec.name}([{spec.name}])" for spec in reversed(graph)]
    lines.append(f"  {topics.RECORDER}[({topics.RECORDER})]")
    for spec in reversed(graph):
        for topic in spec.publishes:
            lines += [
                _arrow(spec.name, "-->", topic.name, other.name)
                for other in graph
                if topic in other.subscribes and topic not in pace_only(other)
            ]
    lines += [_arrow(spec.name, "-->", "all topics", topics.RECORDER) for spec in reversed(graph)]
    lines += [
        _arrow(spec.name, "-.->", f"stamps of {spec.answer.name}", topics.RIG)
        for spec in reversed(graph)
        if spec.answer is not None
    ]
    progress = topics.RECORDER_PROGRESS.name
    lines.append(_arrow(topics.RECORDER, "-.->", f"stamps of {progress}", topics.RIG))
    return "\n".join(lines)


def pace_only(spec: NodeSpec) -> tuple[Topic, ...]:
    """Return the topics that a node listens to for their stamps alone."""
    return spec.subscribes if spec.name == topics.RIG else ()


def _arrow(source: str, line: str, label: str, target: str) -> str:
    return f'  {source} {line}|"{label}"| {target}'
