"""The graph as data: which nodes there are, what they publish, and who listens."""

import importlib
from dataclasses import dataclass, replace
from enum import Enum

from winding_ros import topics
from winding_ros.topic import Topic

DEFAULT_NAMESPACE = "winding"


class Policy(Enum):
    """What becomes of a run in which a node died or hangs; the machine is stopped first."""

    END = "the run ends"
    RESTART = "the node is started again and the run resumes"
    REPLAY = "the node is started again, replays the run's inputs, and the run resumes"
    ASIDE = "the node is started again and the machine goes on meanwhile"


@dataclass(frozen=True, kw_only=True)
class NodeSpec:
    """One node of the graph; what it publishes stands with the topics."""

    name: str  # Node name.
    package: str = ""  # Python package; `python -m package` is the node's process.
    parameters_class: str = ""  # Class in `package.ros.parameters` that states its parameters.
    # Class in `package.ros.message_handler` that does its work; empty where messages alone do not
    # determine its answers.
    handler_class: str = ""
    # Topics that the handler takes, those first that the others are read with: of what has arrived
    # together, and of messages with the same stamp, this is the order.
    inputs: tuple[Topic, ...] = ()
    # Those of them that are dealt with as soon as they come; the others are taken with these, and
    # every few milliseconds.
    triggers: tuple[Topic, ...] = ()
    # Topics that the node subscribes to without its handler.
    extra_subscriptions: tuple[Topic, ...] = ()
    # Topics that it publishes without its handler, as further threads end.
    extra_publications: tuple[Topic, ...] = ()
    policy: Policy = Policy.END  # What becomes of the run when the node fails.
    # What it publishes where that differs from the topics' publishers.
    publications: tuple[Topic, ...] | None = None
    arguments: tuple[str, ...] = ()  # Of that process, before those for ROS.

    @property
    def command(self) -> tuple[str, ...]:
        """What follows `python` to run the node's process, without arguments for ROS."""
        return ("-m", self.package, *self.arguments)

    @property
    def publishes(self) -> tuple[Topic, ...]:
        """Topics it publishes, /diagnostics aside."""
        return topics.published_by(self.name) if self.publications is None else self.publications

    @property
    def outputs(self) -> tuple[Topic, ...]:
        """Topics on which its handler answers."""
        return tuple(topic for topic in self.publishes if topic not in self.extra_publications)

    @property
    def subscribes(self) -> tuple[Topic, ...]:
        """Topics it listens to, /clock aside."""
        return (*self.inputs, *self.extra_subscriptions)

    @property
    def answer(self) -> Topic | None:
        """Topic whose stamps show how far the node has come."""
        return next((topic for topic in self.publishes if topic.answer), None)


CORRECTION = NodeSpec(
    name=topics.CORRECTION,
    package="correction_node",
    parameters_class="CorrectionParameters",
    handler_class="CorrectionHandler",
    inputs=(topics.TRACKED_MARKERS, topics.FEM_MARKERS),
    # Lengths are published with predictions; the tracker's messages since then are taken with them.
    triggers=(topics.FEM_MARKERS,),
    policy=Policy.RESTART,
)
FEM = NodeSpec(
    name=topics.FEM,
    package="cable_fem_node",
    parameters_class="FemParameters",
    handler_class="FemHandler",
    inputs=(topics.TENSION, topics.JOINT_STATES),
    extra_subscriptions=(topics.TRACKED_MARKERS,),
    extra_publications=(topics.FEM_MATERIAL,),
    policy=Policy.REPLAY,
)
TRACKER = NodeSpec(
    name=topics.TRACKER,
    package="marker_tracker_node",
    parameters_class="TrackerParameters",
    handler_class="TrackerHandler",
    inputs=(topics.CAMERA_INFO, topics.JOINT_STATES, topics.IMAGE),
    triggers=(topics.IMAGE,),
    policy=Policy.REPLAY,
)
RIG = NodeSpec(
    name=topics.RIG,
    package="winding_rig_node",
    parameters_class="RigParameters",
    # Commands, and the answers' stamps alone: they hold simulated time.
    extra_subscriptions=(
        *topics.published_by(topics.COMMANDER),
        *(topic for topic in topics.TOPICS if topic.answer),
    ),
)
LAY_CONTROL = NodeSpec(
    name=topics.LAY_CONTROL,
    package="lay_control_node",
    parameters_class="LayControlParameters",
    handler_class="LayControlHandler",
    inputs=(
        topics.TENSION,
        topics.FEM_MARKERS,
        topics.TRACKED_LAY,
        topics.TRACKED_MARKERS,
        topics.JOINT_STATES,
    ),
    policy=Policy.RESTART,
    publications=(topics.LAY_CONTROL_STATE, topics.JOINT_TARGETS, topics.TENSION_COMMAND),
)
# Sinks first, the rig last: subscribers are active before publishers.
GRAPH: tuple[NodeSpec, ...] = (CORRECTION, FEM, TRACKER, RIG)


def controlled(graph: tuple[NodeSpec, ...] = GRAPH) -> tuple[NodeSpec, ...]:
    """Return a graph with the controller of the lay, which hears all and is heard by the rig."""
    others = tuple(spec for spec in graph if spec is not RIG)
    return (*others, LAY_CONTROL, *(spec for spec in graph if spec is RIG))


def members(*, external: bool, camera: bool, control: bool) -> tuple[NodeSpec, ...]:
    """Return the nodes of a run: a machine's driver stands for the rig, no camera needs no tracker.

    Args:
        external: Whether the machine has a driver of its own.
        camera: Whether an external machine has a camera.
        control: Whether the lay is controlled.
    """
    absent = ((RIG,) if external else ()) + ((TRACKER,) if external and not camera else ())
    graph = tuple(spec for spec in GRAPH if spec not in absent)
    return controlled(graph) if control else graph


CAMERA_TOPICS = (topics.IMAGE, topics.CAMERA_INFO, topics.PREVIEW)
# The simulated camera where it runs in the tracker's process.
SIMULATED_CAMERA = "winding_rig_node.ros.hosted_camera:open_camera"
COMPOSED_TRACKER = replace(
    TRACKER,
    inputs=(topics.JOINT_STATES,),
    triggers=(),
    publications=(*TRACKER.publishes, *CAMERA_TOPICS),
    extra_publications=CAMERA_TOPICS,
)


def composed(graph: tuple[NodeSpec, ...], camera: str) -> tuple[NodeSpec, ...]:
    """Return a graph whose camera runs in the tracker's process and hands its frames over.

    Args:
        graph: The nodes.
        camera: What opens the camera, as MODULE:FUNCTION or FILE.py:FUNCTION.
    """
    others = {
        TRACKER.name: replace(COMPOSED_TRACKER, arguments=("--camera", camera)),
        RIG.name: replace(
            RIG, publications=tuple(t for t in RIG.publishes if t not in CAMERA_TOPICS)
        ),
    }
    return tuple(others.get(spec.name, spec) for spec in graph)


# The tracker of a driver whose frames come compressed.
COMPRESSED_TRACKER = replace(
    TRACKER,
    inputs=(topics.CAMERA_INFO, topics.JOINT_STATES, topics.PREVIEW),
    triggers=(topics.PREVIEW,),
    arguments=("--compressed",),
)


def compressed(graph: tuple[NodeSpec, ...]) -> tuple[NodeSpec, ...]:
    """Return a graph whose tracker takes compressed frames in place of raw ones."""
    return tuple(COMPRESSED_TRACKER if spec is TRACKER else spec for spec in graph)


# No part of the graph: it looks and asks, and the graph is whole without it.
PAGE = NodeSpec(
    name=topics.DASHBOARD,
    package="winding_dashboard",
    parameters_class="DashboardParameters",
    extra_subscriptions=tuple(
        topic
        for topic in topics.TOPICS
        if topic not in (topics.CLOCK, topics.IMAGE, topics.RECORDER_PROGRESS, topics.TRACE)
        and topic.publisher not in (topics.COMMANDER, topics.ORCHESTRATOR, topics.RUN_SERVER)
    ),
    policy=Policy.ASIDE,
)


def parameters_of(spec: NodeSpec) -> type:
    """Return the dataclass that states a node's parameters; importing it needs no ROS."""
    module = importlib.import_module(f"{spec.package}.ros.parameters")
    declared: type = getattr(module, spec.parameters_class)
    return declared


def without_replay(graph: tuple[NodeSpec, ...] = GRAPH) -> dict[str, dict[str, object]]:
    """Return the parameters, by node, with which a node that was started again forgets its run."""
    return {spec.name: {"replay": ""} for spec in graph if spec.policy is Policy.REPLAY}


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
    lines.append(f"{topics.COMMANDER}  (outside the graph)")
    lines += [
        f"  {topic.name}  [{topic.type_name}, on change]  -> {RIG.name}"
        for topic in topics.published_by(topics.COMMANDER)
    ]
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
                if topic in other.subscribes and other is not RIG
            ]
    lines += [_arrow(spec.name, "-->", "all topics", topics.RECORDER) for spec in reversed(graph)]
    lines += [
        _arrow(spec.name, "-.->", f"stamps of {spec.answer.name}", topics.RIG)
        for spec in reversed(graph)
        if spec.answer is not None
    ]
    progress = topics.RECORDER_PROGRESS.name
    lines.append(_arrow(topics.RECORDER, "-.->", f"stamps of {progress}", topics.RIG))
    lines += [
        _arrow(topics.COMMANDER, "-.->", topic.name, topics.RIG)
        for topic in topics.published_by(topics.COMMANDER)
    ]
    return "\n".join(lines)


def _arrow(source: str, line: str, label: str, target: str) -> str:
    return f'  {source} {line}|"{label}"| {target}'


class GraphError(RuntimeError):
    """The graph could not be brought up or kept up; the message names the culprit."""
