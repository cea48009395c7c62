"""The access policy follows from the graph, and a secure run refuses to run open."""

import os
import xml.etree.ElementTree as ET
from importlib.resources import files
from pathlib import Path

import pytest

from winding_ros import topics
from winding_ros.graph import GRAPH, PAGE, controlled
from winding_ros.security import SecurityError, check_security, sros2_policy
from winding_ros.services import served_by

SHIPPED = files("winding_bringup") / "policy" / "sros2_policy.xml"
SECURE = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}


def allowed(policy: str, node: str, kind: str, verb: str) -> set[str]:
    root = ET.fromstring(policy)
    return {
        item.text or ""
        for profile in root.iterfind(f".//profile[@node='{node}']")
        for group in profile.iterfind(kind)
        if group.get(verb) == "ALLOW"
        for item in group
    }


def test_the_shipped_policy_is_current() -> None:
    assert SHIPPED.read_text(encoding="utf-8") == sros2_policy("winding")


def test_a_node_may_do_what_the_graph_declares_and_no_more() -> None:
    policy = sros2_policy("cell")
    assert controlled()
    for spec in controlled():
        own = {
            *("/rosout", "/parameter_events", "/diagnostics", "trace"),
            *(f"{spec.name}/transition_event", f"{spec.name}/heartbeat"),
        }
        published = {topic.name for topic in spec.publishes}
        assert allowed(policy, spec.name, "topics", "publish") == published | own
        heard = allowed(policy, spec.name, "topics", "subscribe") - {
            *(topics.CLOCK.name, "orchestrator/heartbeat")
        }
        assert heard == {topic.name for topic in spec.subscribes}


def test_only_the_orchestrator_and_the_page_command_the_machine() -> None:
    policy = sros2_policy("cell")
    for spec in controlled():
        # Anybody may ask for a stop (winding_ros.runtime.endpoints).
        asked = allowed(policy, spec.name, "services", "request")
        assert asked == {"rig/quick_stop", "rig/stop"}
    for node in ("orchestrator", PAGE.name):
        assert set(served_by(topics.RIG)) <= allowed(policy, node, "services", "request")
    recording = set(served_by(topics.RECORDER))
    assert recording <= allowed(policy, PAGE.name, "services", "request")
    assert recording == allowed(policy, topics.RECORDER, "services", "reply")
    assert set(served_by(topics.RIG)) <= allowed(policy, topics.RIG, "services", "reply")


def test_only_a_commander_and_the_lay_controller_publish_commands_for_the_machine() -> None:
    lay = {topics.JOINT_TARGETS, topics.TENSION_COMMAND}
    root = ET.fromstring(sros2_policy("cell"))
    assert topics.published_by(topics.COMMANDER)
    for topic in topics.published_by(topics.COMMANDER):
        publishers = {
            profile.get("node")
            for profile in root.iter("profile")
            if topic.name
            in allowed(sros2_policy("cell"), profile.get("node") or "", "topics", "publish")
        }
        assert publishers == {topics.COMMANDER} | ({topics.LAY_CONTROL} if topic in lay else set())


def test_every_node_has_an_enclave_in_its_namespace() -> None:
    paths = {item.get("path") for item in ET.fromstring(sros2_policy("cell")).iter("enclave")}
    beside = {"/cell/orchestrator", "/cell/commander", "/cell/run_server"}
    assert paths == {f"/cell/{spec.name}" for spec in (*controlled(), PAGE)} | beside


def test_a_secure_run_without_the_settings_is_refused() -> None:
    with pytest.raises(SecurityError, match="ROS_SECURITY_ENABLE=true, got nothing"):
        check_security("winding", {})
    with pytest.raises(SecurityError, match="Enforce, got Permissive"):
        check_security("winding", SECURE | {"ROS_SECURITY_STRATEGY": "Permissive"})
    with pytest.raises(SecurityError, match="ROS_SECURITY_KEYSTORE"):
        check_security("winding", SECURE)


NODES = (*(spec.name for spec in GRAPH), "orchestrator")


def make_enclaves(keystore: Path) -> None:
    """Write every file that the nodes of a run need, none of them a key."""
    for node in NODES:
        folder = keystore / "enclaves" / "winding" / node
        folder.mkdir(parents=True)
        for name in ("cert.pem", "key.pem", "governance.p7s", "permissions.p7s"):
            (folder / name).write_text("not a key")


@pytest.mark.parametrize("node", NODES)
def test_a_keystore_without_a_key_is_refused(tmp_path: Path, node: str) -> None:
    make_enclaves(tmp_path)
    (tmp_path / "enclaves" / "winding" / node / "key.pem").unlink()
    with pytest.raises(SecurityError, match=rf"no key\.pem in .*/{node}$"):
        check_security("winding", SECURE | {"ROS_SECURITY_KEYSTORE": str(tmp_path)})


def test_a_middleware_without_security_is_refused(tmp_path: Path) -> None:
    make_enclaves(tmp_path)
    keystore = {"ROS_SECURITY_KEYSTORE": str(tmp_path)}
    with pytest.raises(SecurityError, match="the middleware makes no node"):
        check_security("winding", dict(os.environ) | SECURE | keystore)


@pytest.mark.slow
def test_the_command_refuses_before_anything_starts(tmp_path: Path, command) -> None:  # type: ignore[no-untyped-def]
    done = command("run", "--secure", "--case", 4, "--output", tmp_path / "run", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("winding: a secure run needs ROS_SECURITY_ENABLE=true")
    assert not (tmp_path / "run").exists()
