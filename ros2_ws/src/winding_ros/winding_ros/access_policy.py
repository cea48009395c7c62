"""Which process of a run may publish, hear, ask for and serve what, as data and as SROS2 policy."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from winding_ros import topics
from winding_ros.environment import enclave
from winding_ros.graph import DEFAULT_NAMESPACE, GRAPH, PAGE, RIG, NodeSpec
from winding_ros.runtime.heartbeat import heartbeat_topic
from winding_ros.services import QUICK_STOP, SEND_GOAL, SERVICES, STOP, served_by
from winding_ros.topic import Topic
from winding_ros.topics import ORCHESTRATOR

# What rclpy serves for every node, for one with parameters, and for one with a lifecycle.
_TYPES = ("get_type_description",)
_PARAMETERS = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
)
_LIFECYCLE = (
    "change_state",
    "get_state",
    "get_available_states",
    "get_available_transitions",
    "get_transition_graph",
)
_EVERY_NODE = ("/rosout", "/parameter_events", topics.DIAGNOSTICS.name)


@dataclass(frozen=True, kw_only=True)
class Participants:
    """What takes part in a run beside orchestrator and recorder."""

    graph: tuple[NodeSpec, ...] = GRAPH  # Its nodes; without the rig, a driver stands for it
    page: bool = False  # Whether an operator's page is served
    server: bool = False  # Whether a cell controller starts it by goals
    commander: bool = False  # Whether a program outside of the graph commands the machine

    @property
    def enclaves(self) -> tuple[str, ...]:
        """Names of the processes that need keys, the driver's and the commander's aside."""
        page = (PAGE.name,) if self.page else ()
        return (*(spec.name for spec in self.graph), *page, ORCHESTRATOR)


@dataclass(frozen=True, kw_only=True)
class Grant:
    """What one node may do; names are relative to the namespace, or absolute."""

    enclave: str  # Of its process, by the node that this is called after
    node: str  # Its name
    publish: tuple[str, ...] = ()  # Topics beside those of every node
    subscribe: tuple[str, ...] = ()  # Topics
    reply: tuple[str, ...] = ()  # Services that it serves
    request: tuple[str, ...] = ()  # Services that it calls


def grants(taking_part: Participants) -> Iterator[Grant]:
    """Yield what every node of a run may do, and no more.

    Anybody may ask the machine to stop. Only orchestrator and page ask for transitions, parameters
    and the other services of the machine; only the controller of the lay, and a commander where
    there is one, publish commands for it.
    """
    graph = taking_part.graph
    lifecycle = [name for spec in graph for name in _own(spec.name, *_LIFECYCLE, *_PARAMETERS)]
    driven = RIG.name not in (spec.name for spec in graph)
    there = {spec.name for spec in graph} | {ORCHESTRATOR, topics.RECORDER, RIG.name}
    served = tuple(service.name for service in SERVICES if service.server in there)
    for spec in graph:
        signs = (heartbeat_topic(spec.name), f"{spec.name}/transition_event", topics.TRACE.name)
        yield Grant(
            enclave=spec.name,
            node=spec.name,
            publish=(*_names(spec.publishes), *signs),
            # Every node, the rig too, follows simulated time.
            subscribe=(*_names(spec.subscribes), topics.CLOCK.name, heartbeat_topic(ORCHESTRATOR)),
            reply=(*_own(spec.name, *_LIFECYCLE, *_PARAMETERS), *served_by(spec.name)),
            # Whoever is given nothing it can use asks the machine to stop, and nothing else.
            request=(QUICK_STOP.name, STOP.name),
        )
    if driven:
        yield Grant(
            enclave=RIG.name,
            node=RIG.name,
            publish=tuple(t.name for t in RIG.publishes if t is not topics.CLOCK),
            subscribe=_names(topics.published_by(topics.COMMANDER)),
            reply=(*_own(RIG.name, *_PARAMETERS), *served_by(RIG.name)),
        )
    alive = [heartbeat_topic(name) for name in taking_part.enclaves if name != ORCHESTRATOR]
    yield Grant(
        enclave=ORCHESTRATOR,
        node=ORCHESTRATOR,
        publish=(heartbeat_topic(ORCHESTRATOR), *_names(topics.published_by(ORCHESTRATOR))),
        subscribe=(topics.DIAGNOSTICS.name, topics.TRACE.name, *alive),
        reply=(*_own(ORCHESTRATOR, *_PARAMETERS), *served_by(ORCHESTRATOR)),
        request=(*served_by(RIG.name), *lifecycle),
    )
    # The recorder shares the orchestrator's process, and so its keys.
    yield Grant(
        enclave=ORCHESTRATOR,
        node=topics.RECORDER,
        publish=(topics.RECORDER_PROGRESS.name,),
        subscribe=_names(topic for topic in topics.TOPICS if topic.recorded),
        reply=served_by(topics.RECORDER),
    )
    if taking_part.page:
        yield Grant(
            enclave=PAGE.name,
            node=PAGE.name,
            publish=(heartbeat_topic(PAGE.name),),
            reply=_own(PAGE.name, *_PARAMETERS),
            request=(*served, *lifecycle),
        )
        yield Grant(enclave=PAGE.name, node=f"{PAGE.name}_eyes", subscribe=_names(PAGE.subscribes))
    if taking_part.commander:
        # Whatever node commands the machine runs under this one enclave.
        seen = (topics.CLOCK, topics.DIAGNOSTICS, topics.JOINT_STATES, topics.TENSION)
        yield Grant(
            enclave=topics.COMMANDER,
            node=topics.COMMANDER,
            publish=_names(topics.published_by(topics.COMMANDER)),
            subscribe=_names(seen),
        )
    if taking_part.server:
        yield Grant(
            enclave=topics.RUN_SERVER,
            node=topics.RUN_SERVER,
            publish=_names(topics.published_by(topics.RUN_SERVER)),
            subscribe=(topics.CORRECTED_MARKERS.name,),
            reply=(*_own(topics.RUN_SERVER, *_PARAMETERS), *served_by(topics.RUN_SERVER)),
            # It looks for another server before it serves.
            request=(SEND_GOAL.name,),
        )


def sros2_policy(namespace: str, taking_part: Participants) -> str:
    """Return a run's access policy as SROS2 policy XML (version 0.2.0).

    Args:
        namespace: Of the graph, without slashes around it.
        taking_part: Nodes and others of the run.
    """
    root = ET.Element("policy", version="0.2.0")
    enclaves = ET.SubElement(root, "enclaves")
    processes: dict[str, ET.Element] = {}
    for grant in grants(taking_part):
        if grant.enclave not in processes:
            own = ET.SubElement(enclaves, "enclave", path=enclave(namespace, grant.enclave))
            processes[grant.enclave] = ET.SubElement(own, "profiles")
        profile = ET.SubElement(
            processes[grant.enclave], "profile", ns=f"/{namespace}", node=grant.node
        )
        for kind, verb, names in (
            ("topic", "publish", (*_EVERY_NODE, *grant.publish)),
            ("topic", "subscribe", grant.subscribe),
            ("service", "reply", (*_own(grant.node, *_TYPES), *grant.reply)),
            ("service", "request", grant.request),
        ):
            group = ET.SubElement(profile, f"{kind}s", {verb: "ALLOW"}) if names else profile
            for name in names:
                ET.SubElement(group, kind).text = _placed(namespace, name)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _own(node: str, *services: str) -> tuple[str, ...]:
    return tuple(f"{node}/{name}" for name in services)


def _names(declared: Iterable[Topic]) -> tuple[str, ...]:
    return tuple(topic.name for topic in declared)


def _placed(namespace: str, name: str) -> str:
    """Return a name as nodes of a namespace resolve it: other graphs have clocks of their own."""
    if name == topics.CLOCK.name and namespace != DEFAULT_NAMESPACE:
        return f"/{namespace}{name}"
    return name
