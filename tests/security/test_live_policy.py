"""Every endpoint of a live graph stands in the policy of its run; an outsider's stand in none."""

import json
import subprocess
import urllib.request
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from processes import COMMAND, free_port
from winding_ros import services, topics
from winding_ros.access_policy import Participants, grants, sros2_policy
from winding_ros.graph import PAGE, controlled, members

pytestmark = [pytest.mark.processes, pytest.mark.campaign, pytest.mark.timeout(900)]

OUTSIDER, PATIENCE = "outsider", 400.0
Endpoints = set[tuple[str, str, str, str]]


def seen_from(node: Any, namespace: str) -> Endpoints:
    """Return what the nodes of a namespace have open now: node, kind, verb, full name."""
    found: Endpoints = set()
    for name, place in node.get_node_names_and_namespaces():
        if place != f"/{namespace}":
            continue
        for kind, verb, ask in (
            ("topics", "publish", node.get_publisher_names_and_types_by_node),
            ("topics", "subscribe", node.get_subscriber_names_and_types_by_node),
            ("services", "reply", node.get_service_names_and_types_by_node),
            ("services", "request", node.get_client_names_and_types_by_node),
        ):
            try:
                found |= {(name, kind, verb, item) for item, _ in ask(name, place)}
            except RuntimeError:
                # It left between the two questions.
                break
    return found


def uncovered(found: Endpoints, namespace: str, taking_part: Participants) -> Endpoints:
    """Return the endpoints that a policy does not allow to the process of their node."""
    process = {grant.node: f"/{namespace}/{grant.enclave}" for grant in grants(taking_part)}
    may = {
        (own.get("path"), group.tag, verb, item.text if item.text[0] == "/" else
         f"/{namespace}/{item.text}")
        for own in ET.fromstring(sros2_policy(namespace, taking_part)).iter("enclave")
        for group in own.iterfind("profiles/profile/*")
        for verb in group.attrib
        for item in group
        if item.text
    }  # fmt: skip
    return {item for item in found if (process.get(item[0]), *item[1:]) not in may}


@contextmanager
def winding(*words: object) -> Iterator["subprocess.Popen[str]"]:
    process = subprocess.Popen([*COMMAND, *map(str, words)], stdout=subprocess.PIPE, text=True)
    try:
        yield process
        process.terminate()
        process.wait(120.0)
    finally:
        process.kill()


def post(url: str, path: str, **more: Any) -> str:
    """Ask the page for something; return why it is refused, or nothing."""
    with urllib.request.urlopen(f"{url}snapshot", timeout=60.0) as answer:
        seen = json.load(answer)
    body = json.dumps({"server": seen["server"], "sequence": seen["sequence"], **more}).encode()
    asked = urllib.request.Request(f"{url}{path}", body, {"Content-Type": "application/json"})
    with urllib.request.urlopen(asked, timeout=PATIENCE) as answer:
        found = json.load(answer)
    return found["answer"] if found["refused"] else ""


def test_a_run_with_page_and_controller_keeps_to_its_policy(ros: Any, tmp_path: Path) -> None:
    namespace, serving_port = "kept", free_port()
    probe = ros.add(Node, "probe", namespace="elsewhere")
    url = f"http://127.0.0.1:{serving_port}/"
    with winding(
        *("run", "--case", 4, "--duration-s", 8, "--namespace", namespace, "--control", "drive"),
        *("--pitch-mm", 3, "--lay", "driven", "--dashboard", "--dashboard-port", serving_port),
        *("--trace", tmp_path / "trace.json", "--output", tmp_path / "run"),
    ) as run:
        assert run.stdout is not None
        assert any("operator's page" in line for line in run.stdout)
        found: Endpoints = set()

        def look() -> Endpoints:
            nonlocal found
            found |= seen_from(probe, namespace)
            return found

        asked = ("dashboard", "services", "request", f"/{namespace}/cable_fem/get_state")
        ros.spin_until(lambda: asked in look(), PATIENCE)
        form = {"case": 5, "law": "linear", "take_up": False, "fields": {}}
        # The page has to have heard of the present before it prepares another run.
        ros.spin_until(lambda: not post(url, "prepare", form=form), PATIENCE)
        look()
        assert not post(url, "record", on=True)
        assert not post(url, "command/start")
        clock = ("winding_rig", "topics", "subscribe", f"/{namespace}/clock")
        types = ("recorder", "services", "reply", f"/{namespace}/recorder/get_type_description")
        ros.spin_until(lambda: {clock, types} <= look(), PATIENCE)
        assert not post(url, "command/stop")
        look()
        # An outsider publishes a command, listens, calls a service and reads a parameter.
        outsider = ros.add(Node, OUTSIDER, namespace=namespace, start_parameter_services=False)
        outsider.create_publisher(
            topics.JOINT_TARGETS.type, topics.JOINT_TARGETS.name, topics.JOINT_TARGETS.qos
        )
        topics.JOINT_STATES.subscribe(outsider, lambda message: None)
        outsider.create_client(Trigger, services.START.name)
        outsider.create_client(GetParameters, f"{PAGE.name}/get_parameters")
        ros.spin_until(lambda: any(item[0] == OUTSIDER for item in look()), PATIENCE)
    taking_part = Participants(graph=controlled(), page=True)
    assert {item[0] for item in found} == {
        *(spec.name for spec in controlled()),
        *("orchestrator", "recorder", "dashboard", "dashboard_eyes", OUTSIDER),
    }
    refused = uncovered(found, namespace, taking_part)
    assert {item[0] for item in refused} == {OUTSIDER}
    assert refused >= {
        (OUTSIDER, "topics", "publish", f"/{namespace}/rig/joint_targets"),
        (OUTSIDER, "topics", "subscribe", f"/{namespace}/rig/joint_states"),
        (OUTSIDER, "services", "request", f"/{namespace}/rig/start"),
        (OUTSIDER, "services", "request", f"/{namespace}/dashboard/get_parameters"),
    }
    # A run without them lends their rights to no one.
    for less, node in (
        (Participants(graph=controlled()), "dashboard"),
        (Participants(page=True), topics.LAY_CONTROL),
    ):
        assert node in {item[0] for item in uncovered(found, namespace, less)}


def test_a_goal_on_a_real_machine_keeps_its_policy(ros: Any, driver: Any, tmp_path: Path) -> None:
    probe = ros.add(Node, "probe", namespace="elsewhere")
    found: Endpoints = set()

    def look() -> Endpoints:
        nonlocal found
        found |= seen_from(probe, driver.namespace)
        return found

    with winding("serve", "--namespace", driver.namespace, "--output", tmp_path) as server:
        assert server.stdout is not None
        assert any("waiting for goals" in line for line in server.stdout)
        goal = {"case": 4, "duration_s": 4.0, "machine": "external", "camera": False}
        request = SetParametersAtomically.Request(
            parameters=[Parameter(n, value=v).to_parameter_msg() for n, v in goal.items()]
        )
        name = f"/{driver.namespace}/{services.SEND_GOAL.name}"
        answer = ros.call(probe, services.SEND_GOAL.type, name, request)
        assert answer.result.successful, answer.result.reason
        ended = [*tmp_path.glob("*/run.json")]

        def over() -> bool:
            look()
            ended[:] = tmp_path.glob("*/run.json")
            return bool(ended)

        ros.spin_until(over, PATIENCE)
    nodes = members(external=True, camera=False, control=False)
    taking_part = Participants(graph=nodes, server=True)
    assert {item[0] for item in found} == {
        *(spec.name for spec in nodes),
        *("winding_rig", "orchestrator", "recorder", "run_server"),
    }
    assert uncovered(found, driver.namespace, taking_part) == set()
