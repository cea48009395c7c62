"""The access policy follows from what takes part in a run; a secure run refuses to run open."""

import os
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from winding_ros import topics
from winding_ros.access_policy import Participants, grants, sros2_policy
from winding_ros.graph import GRAPH, LAY_CONTROL, PAGE, RIG, TRACKER, controlled, members
from winding_ros.security import SecurityError, check_security
from winding_ros.services import served_by

SECURE = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}
PLAIN = Participants()
WHOLE = Participants(graph=controlled(), page=True, server=True, commander=True)
COMMANDS = {topic.name for topic in topics.published_by(topics.COMMANDER)}


def allowed(policy: str, kind: str, verb: str) -> dict[str, set[str]]:
    """Return what the nodes of a policy may do, by node."""
    return {
        profile.get("node") or "": {
            item.text or ""
            for group in profile.iterfind(kind)
            if group.get(verb) == "ALLOW"
            for item in group
        }
        for profile in ET.fromstring(policy).iter("profile")
    }


def test_a_node_may_do_what_the_graph_declares_and_no_more() -> None:
    policy = sros2_policy("winding", WHOLE)
    published, heard = allowed(policy, "topics", "publish"), allowed(policy, "topics", "subscribe")
    for spec in controlled():
        own = {
            *("/rosout", "/parameter_events", "/diagnostics", "trace"),
            *(f"{spec.name}/transition_event", f"{spec.name}/heartbeat"),
        }
        assert published[spec.name] == {topic.name for topic in spec.publishes} | own
        # Simulated time drives the rig's own clock, too.
        beside = {"/clock", "orchestrator/heartbeat"}
        assert heard[spec.name] == {topic.name for topic in spec.subscribes} | beside


def test_only_the_orchestrator_and_the_page_command_the_machine() -> None:
    policy = sros2_policy("winding", WHOLE)
    asked, served = allowed(policy, "services", "request"), allowed(policy, "services", "reply")
    for spec in controlled():
        assert asked[spec.name] == {"rig/quick_stop", "rig/stop"}
    for node in ("orchestrator", PAGE.name):
        assert set(served_by(topics.RIG)) <= asked[node]
    assert set(served_by(topics.RECORDER)) <= asked[PAGE.name] & served[topics.RECORDER]
    assert set(served_by(topics.RIG)) <= served[topics.RIG]
    for node in ("recorder", "dashboard_eyes", "commander"):
        assert served[node] >= {f"{node}/get_type_description"}


@pytest.mark.parametrize(
    ("taking_part", "publishers"),
    [
        (PLAIN, set()),
        (Participants(page=True, server=True), set()),
        (Participants(graph=controlled()), {topics.LAY_CONTROL}),
        (Participants(commander=True), {topics.COMMANDER}),
        (WHOLE, {topics.LAY_CONTROL, topics.COMMANDER}),
    ],
)
def test_commands_come_from_who_commands(taking_part: Participants, publishers: set[str]) -> None:
    published = allowed(sros2_policy("winding", taking_part), "topics", "publish")
    assert {node for node, names in published.items() if names & COMMANDS} == publishers
    of_lay = {topics.JOINT_TARGETS.name, topics.TENSION_COMMAND.name}
    assert published.get(topics.LAY_CONTROL, set()) & COMMANDS in (set(), of_lay)


def test_who_takes_part_has_an_enclave_in_the_namespace() -> None:
    always = {"correction", "cable_fem", "winding_rig", "orchestrator"}
    external = members(external=True, camera=False, control=False)
    for taking_part, others in (
        (PLAIN, {"marker_tracker"}),
        (Participants(graph=external, page=True), {"dashboard"}),
        (WHOLE, {"marker_tracker", "lay_control", "dashboard", "run_server", "commander"}),
    ):
        root = ET.fromstring(sros2_policy("cell/a", taking_part))
        paths = {f"/cell/a/{node}" for node in always | others}
        assert {item.get("path") for item in root.iter("enclave")} == paths


def test_a_machines_driver_has_neither_clock_nor_lifecycle() -> None:
    nodes = members(external=True, camera=True, control=True)
    assert RIG not in nodes
    assert {TRACKER, LAY_CONTROL} < set(nodes)
    (driver,) = [item for item in grants(Participants(graph=nodes)) if item.node == RIG.name]
    assert set(driver.reply) >= {"rig/start", "rig/emergency_stop"}
    assert not [name for name in driver.reply if name.endswith("change_state")]
    assert topics.CLOCK.name not in driver.publish


def test_another_namespace_has_a_clock_of_its_own() -> None:
    published = allowed(sros2_policy("cell/a", PLAIN), "topics", "publish")
    assert [node for node, names in published.items() if "/cell/a/clock" in names] == [RIG.name]
    assert "/clock" not in published[RIG.name]


def test_a_secure_run_without_the_settings_is_refused() -> None:
    with pytest.raises(SecurityError, match="ROS_SECURITY_ENABLE=true, got nothing"):
        check_security("winding", {})
    with pytest.raises(SecurityError, match="Enforce, got Permissive"):
        check_security("winding", SECURE | {"ROS_SECURITY_STRATEGY": "Permissive"})
    with pytest.raises(SecurityError, match="ROS_SECURITY_KEYSTORE"):
        check_security("winding", SECURE)


def keystore(folder: Path, *nodes: str) -> dict[str, str]:
    """Make files that are no keys, and return the environment that names them."""
    for node in nodes:
        own = folder / "enclaves" / "winding" / node
        own.mkdir(parents=True)
        for name in ("cert.pem", "key.pem", "governance.p7s", "permissions.p7s"):
            (own / name).write_text("not a key")
    return SECURE | {"ROS_SECURITY_KEYSTORE": str(folder)}


def test_a_keystore_without_a_key_is_refused(tmp_path: Path) -> None:
    nodes = [spec.name for spec in GRAPH if spec is not RIG]
    environment = keystore(tmp_path, *nodes, "orchestrator")
    for taking_part, missing in (
        (PLAIN, "winding_rig"),
        (Participants(graph=members(external=True, camera=True, control=True)), "lay_control"),
        (Participants(graph=members(external=True, camera=False, control=False), page=True),
         "dashboard"),
    ):  # fmt: skip
        with pytest.raises(SecurityError, match=rf"no cert\.pem in .*{missing}; `winding graph"):
            check_security("winding", environment, taking_part)


def test_a_middleware_without_security_is_refused(tmp_path: Path) -> None:
    environment = keystore(tmp_path, *(spec.name for spec in GRAPH), "orchestrator")
    with pytest.raises(SecurityError, match=r"makes no node under .*: [^[].*security"):
        check_security("winding", dict(os.environ) | environment)


@pytest.mark.slow
def test_the_command_prints_the_policy_of_a_run(tmp_path: Path, command) -> None:  # type: ignore[no-untyped-def]
    words = ("--sros2", "--namespace", "cell/a", "--machine", "external", "--no-camera")
    done = command("graph", *words, "--control", "--dashboard", "--serve", "--commander",
                   cwd=tmp_path)  # fmt: skip
    nodes = members(external=True, camera=False, control=True)
    expected = Participants(graph=nodes, page=True, server=True, commander=True)
    assert done.stdout == sros2_policy("cell/a", expected)
    refused = command("graph", "--sros2", "--machine", "mine", cwd=tmp_path)
    assert (refused.returncode, refused.stdout) == (2, "")
