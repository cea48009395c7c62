"""DDS security: the access policy of the graph, and a refusal to run open when asked not to."""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from pathlib import Path

from winding_ros import topics
from winding_ros.environment import enclave
from winding_ros.graph import GRAPH, PAGE, NodeSpec, controlled
from winding_ros.runtime.heartbeat import heartbeat_topic
from winding_ros.services import QUICK_STOP, SERVICES, STOP, served_by
from winding_ros.topics import ORCHESTRATOR

# What rclpy serves for every lifecycle node, in its own namespace.
_LIFECYCLE_SERVICES = (
    "change_state",
    "get_state",
    "get_available_states",
    "get_available_transitions",
    "get_transition_graph",
)
_PARAMETER_SERVICES = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
    "get_type_description",
)
_OWN_SERVICES = (*_LIFECYCLE_SERVICES, *_PARAMETER_SERVICES)
_ENCLAVE_FILES = ("cert.pem", "key.pem", "governance.p7s", "permissions.p7s")
_TRIAL = """
import sys, rclpy
rclpy.init(args=["trial", "--ros-args", "--enclave", sys.argv[1]])
rclpy.create_node("security_trial").destroy_node()
rclpy.shutdown()
"""
_TRIAL_TIMEOUT = 60.0


class SecurityError(ValueError):
    """The graph cannot be run with security."""


def sros2_policy(namespace: str, graph: tuple[NodeSpec, ...] = controlled()) -> str:
    """Return the graph's access policy as SROS2 policy XML (version 0.2.0).

    Every node may publish, hear and serve what the graph declares, and ask the machine to stop.
    Only the orchestrator and the operator's page may ask for transitions, parameters and the other
    services of the machine, only a commander may publish commands for its axes.
    """
    root = ET.Element("policy", version="0.2.0")
    enclaves = ET.SubElement(root, "enclaves")
    for spec in graph:
        profile = _profile(_enclave(enclaves, namespace, spec.name), namespace, spec.name)
        heard = [topic.name for topic in spec.subscribes]
        if spec.name != topics.RIG:
            heard.append(topics.CLOCK.name)
        published = [heartbeat_topic(spec.name), f"{spec.name}/transition_event", topics.TRACE.name]
        _allow(profile, "topics", "publish", [*(t.name for t in spec.publishes), *published])
        _allow(profile, "topics", "subscribe", [*heard, heartbeat_topic(ORCHESTRATOR)])
        own = (f"{spec.name}/{name}" for name in _OWN_SERVICES)
        _allow(profile, "services", "reply", [*own, *served_by(spec.name)])
        # Whoever is given nothing it can use asks the machine to stop, and nothing else.
        _allow(profile, "services", "request", [QUICK_STOP.name, STOP.name])
    # Orchestrator and recorder share a process, so they share keys.
    process = _enclave(enclaves, namespace, ORCHESTRATOR)
    profile = _profile(process, namespace, ORCHESTRATOR)
    signs = [heartbeat_topic(spec.name) for spec in (*graph, PAGE)]
    published = [topic.name for topic in topics.published_by(ORCHESTRATOR)]
    _allow(profile, "topics", "publish", [heartbeat_topic(ORCHESTRATOR), *published])
    heard = [topics.DIAGNOSTICS.name, topics.TRACE.name, *signs]
    _allow(profile, "topics", "subscribe", heard)
    asked = [f"{spec.name}/{name}" for spec in graph for name in _OWN_SERVICES]
    _allow(profile, "services", "request", [*served_by(topics.RIG), *asked])
    own = (f"{ORCHESTRATOR}/{n}" for n in _PARAMETER_SERVICES)
    _allow(profile, "services", "reply", [*served_by(ORCHESTRATOR), *own])
    profile = _profile(process, namespace, topics.RECORDER)
    _allow(profile, "topics", "publish", [topics.RECORDER_PROGRESS.name])
    recorded = [topic.name for topic in topics.TOPICS if topic.recorded]
    _allow(profile, "topics", "subscribe", recorded)
    _allow(profile, "services", "reply", served_by(topics.RECORDER))
    profiles = _enclave(enclaves, namespace, PAGE.name)
    profile = _profile(profiles, namespace, PAGE.name)
    _allow(profile, "topics", "publish", [heartbeat_topic(PAGE.name), topics.DIAGNOSTICS.name])
    _allow(
        profile,
        "services",
        "request",
        [*(s.name for s in SERVICES if s.server != topics.RUN_SERVER), *asked],
    )
    _allow(profile, "services", "reply", [f"{PAGE.name}/{n}" for n in _PARAMETER_SERVICES])
    profile = _profile(profiles, namespace, f"{PAGE.name}_eyes")
    _allow(profile, "topics", "subscribe", [topic.name for topic in PAGE.subscribes])
    # Whatever node commands the machine runs under this one enclave.
    outside = _enclave(enclaves, namespace, topics.COMMANDER)
    profile = _profile(outside, namespace, topics.COMMANDER)
    _allow(profile, "topics", "publish", [t.name for t in topics.published_by(topics.COMMANDER)])
    seen = (topics.CLOCK, topics.DIAGNOSTICS, topics.JOINT_STATES, topics.TENSION)
    _allow(profile, "topics", "subscribe", [topic.name for topic in seen])
    process = _enclave(enclaves, namespace, topics.RUN_SERVER)
    profile = _profile(process, namespace, topics.RUN_SERVER)
    published = [topic.name for topic in topics.published_by(topics.RUN_SERVER)]
    _allow(profile, "topics", "publish", published)
    _allow(profile, "topics", "subscribe", [topics.CORRECTED_MARKERS.name])
    own = (f"{topics.RUN_SERVER}/{n}" for n in _PARAMETER_SERVICES)
    _allow(profile, "services", "reply", [*served_by(topics.RUN_SERVER), *own])
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def check_security(
    namespace: str,
    environment: Mapping[str, str] = os.environ,
    graph: tuple[NodeSpec, ...] = GRAPH,
) -> None:
    """Refuse unless every process of the graph would authenticate and encrypt.

    Raises:
        SecurityError: A setting, a key or the middleware's security is missing.
    """
    for name, wanted in (("ROS_SECURITY_ENABLE", "true"), ("ROS_SECURITY_STRATEGY", "Enforce")):
        if environment.get(name) != wanted:
            raise SecurityError(
                f"a secure run needs {name}={wanted}, got {environment.get(name) or 'nothing'}"
            )
    keystore = environment.get("ROS_SECURITY_KEYSTORE", "")
    if not keystore or not Path(keystore).is_dir():
        raise SecurityError(
            f"a secure run needs ROS_SECURITY_KEYSTORE, got {keystore or 'nothing'}: no such folder"
        )
    for node in (*(spec.name for spec in graph), ORCHESTRATOR):
        folder = Path(keystore) / "enclaves" / namespace / node
        missing = [name for name in _ENCLAVE_FILES if not (folder / name).is_file()]
        if missing:
            raise SecurityError(f"the keystore has no {missing[0]} in {folder}")
    _try_middleware(enclave(namespace, ORCHESTRATOR), environment)


def _try_middleware(name: str, environment: Mapping[str, str]) -> None:
    """Make one node under the enclave in a process of its own; a library may end the process."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _TRIAL, name],
            env=dict(environment),
            capture_output=True,
            text=True,
            timeout=_TRIAL_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise SecurityError(
            f"no node came up under enclave {name} in {_TRIAL_TIMEOUT:g} s"
        ) from None
    if done.returncode != 0:
        reason = [line for line in (done.stderr + done.stdout).splitlines() if "ecurity" in line]
        raise SecurityError(
            f"the middleware makes no node under enclave {name}: "
            + (reason[0].strip() if reason else f"exit code {done.returncode}")
        )


def _enclave(enclaves: ET.Element, namespace: str, node: str) -> ET.Element:
    own = ET.SubElement(enclaves, "enclave", path=enclave(namespace, node))
    return ET.SubElement(own, "profiles")


def _profile(profiles: ET.Element, namespace: str, node: str) -> ET.Element:
    profile = ET.SubElement(profiles, "profile", ns=f"/{namespace}", node=node)
    shared = ["/rosout", "/parameter_events", topics.DIAGNOSTICS.name]
    _allow(profile, "topics", "publish", shared)
    return profile


def _allow(profile: ET.Element, kind: str, verb: str, names: Iterable[str]) -> None:
    group = ET.SubElement(profile, kind, {verb: "ALLOW"})
    for name in names:
        ET.SubElement(group, kind.removesuffix("s")).text = name
