"""The graph as data agrees with nodes and documents; a graph keeps to its host's loopback."""

import os
from pathlib import Path
from typing import Any

import pytest
from rclpy.lifecycle import TransitionCallbackReturn

from winding_cli.commands.graph import as_markdown
from winding_ros import topics
from winding_ros.environment import set_process_environment
from winding_ros.graph import (
    GRAPH,
    LAY_CONTROL,
    RIG,
    as_mermaid,
    as_text,
    controlled,
    expected_subscribers,
    pace_topics,
    parameters_of,
)

ROOT = Path(__file__).parents[2]
# What rclpy gives every node by itself.
OF_RCLPY = {"/rosout", "/parameter_events", "/endpoints/parameter_events"}
# Names of their own: the graph's picture of itself goes by node name.
NAMESPACE = "/endpoints"
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
SET = (RANGE, PROFILES, "ROS_DOMAIN_ID", "ROS_LOG_DIR", "RCUTILS_CONSOLE_OUTPUT_FORMAT")


def test_every_topic_has_a_publisher() -> None:
    published = {topic for spec in controlled() for topic in spec.publishes}
    outside = set(topics.published_by(topics.COMMANDER))
    served = set(topics.published_by(topics.RUN_SERVER))
    shared = {
        topics.DIAGNOSTICS, topics.RECORDER_PROGRESS, topics.ROBOT_DESCRIPTION, topics.TRACE,
    }  # fmt: skip
    # The controller of the lay is one of those who may command the axes.
    assert published & outside == {topics.JOINT_TARGETS, topics.TENSION_COMMAND}
    assert set(topics.TOPICS) - published == (shared | outside | served) - published
    assert outside <= set(RIG.subscribes)


def test_listeners_come_before_those_they_listen_to() -> None:
    order = [spec.name for spec in GRAPH]
    for spec in GRAPH[:-1]:
        for topic in spec.subscribes:
            if topic.publisher != spec.name and topic is not topics.TRACKED_MARKERS:
                assert order.index(spec.name) < order.index(topic.publisher)
    assert order[-1] == topics.RIG


def test_every_consumer_holds_time() -> None:
    answers = {topic.name for topic in pace_topics()}
    assert answers == {
        "tracker/markers", "fem/markers", "correction/markers", "recorder/progress",
    }  # fmt: skip
    assert {topic.name for topic in pace_topics(controlled())} == answers | {"lay_control/state"}


def endpoints(node: Any) -> tuple[set[str], set[str]]:
    """Return the topics that a node publishes and hears, but for those that every node has."""
    name = node.get_name()
    shared = {
        f"{NAMESPACE}/{name}/transition_event",
        "/diagnostics",
        f"{NAMESPACE}/trace",
        f"{NAMESPACE}/{name}/heartbeat",
        f"{NAMESPACE}/orchestrator/heartbeat",
    }
    published = node.get_publisher_names_and_types_by_node(name, NAMESPACE)
    heard = node.get_subscriber_names_and_types_by_node(name, NAMESPACE)
    return (
        {topic for topic, _ in published} - OF_RCLPY - shared,
        {topic for topic, _ in heard} - OF_RCLPY - shared - {f"{NAMESPACE}/clock"},
    )


@pytest.mark.slow
def test_nodes_really_have_the_endpoints_that_the_graph_states(ros: Any, compose: Any) -> None:
    specs = controlled()
    assert specs
    paced = ",".join(topic.name for topic in pace_topics(specs))
    graph = compose(
        ros,
        {topics.RIG: {"pace_topics": paced}},
        namespace=NAMESPACE.removeprefix("/"),
        specs=specs,
    )
    for spec in specs:
        node = graph.nodes[spec.name]
        stated = (
            {f"{NAMESPACE}/{topic.name.lstrip('/')}" for topic in spec.publishes},
            {f"{NAMESPACE}/{topic.name.lstrip('/')}" for topic in spec.subscribes},
        )
        # The graph's own picture of itself takes a moment to be complete.
        ros.spin_until(lambda node=node, stated=stated: endpoints(node) == stated)
    for node in graph.nodes.values():
        assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    graph.close()


def test_expected_subscribers_count_recorder_and_clock() -> None:
    expected = expected_subscribers(frozenset({"fem/markers"}))
    # The correction, the rig's flow control and the recorder listen to fem/markers.
    assert expected["cable_fem"]["fem/markers"] == 3
    assert expected["winding_rig"]["/clock"] == len(GRAPH) - 1


def test_controller_of_the_lay_hears_all_and_is_heard_by_the_rig() -> None:
    expected = expected_subscribers(frozenset(), controlled())
    without = expected_subscribers(frozenset())
    assert expected["lay_control"] == {
        "lay_control/state": 1,
        "rig/joint_targets": 1,
        "rig/tension_command": 1,
    }
    for node, topic in (
        ("winding_rig", "rig/joint_states"),
        ("winding_rig", "rig/tension"),
        ("marker_tracker", "tracker/markers"),
        ("marker_tracker", "tracker/lay"),
        ("cable_fem", "fem/markers"),
    ):
        assert expected[node][topic] == without[node][topic] + 1


def test_text_names_every_node_and_topic() -> None:
    text = as_text()
    assert GRAPH
    for spec in GRAPH:
        assert spec.name in text
        for topic in spec.publishes:
            assert topic.name in text


def test_parameters_of_every_node_can_be_read_without_starting_it() -> None:
    assert set(controlled()) == {*GRAPH, LAY_CONTROL}
    for spec in controlled():
        declared = parameters_of(spec)
        assert declared.__name__ == spec.parameters_class
        assert declared().resolved().case.number == 4


def test_readme_shows_this_graph() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"```mermaid\n{as_mermaid()}\n```" in readme, "paste `winding graph --mermaid`"


def test_interface_document_is_the_declared_one() -> None:
    document = (ROOT / "docs" / "interfaces.md").read_text(encoding="utf-8")
    assert as_markdown() in document, "paste `winding graph --interfaces`"


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Take away what the command sets; the test's end brings back what the suite has set."""
    for name in SET:
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    return monkeypatch


@pytest.mark.parametrize("wanted", [None, "LOCALHOST"])
def test_this_host_means_the_loopback_and_no_shared_memory(
    bare: pytest.MonkeyPatch, tmp_path: Path, wanted: str | None
) -> None:
    if wanted:
        bare.setenv(RANGE, wanted)
    for _ in range(2):
        set_process_environment(7, tmp_path)
        # With LOCALHOST the middleware would add shared memory by itself.
        assert os.environ[RANGE] == "SYSTEM_DEFAULT"
    profile = Path(os.environ[PROFILES]).read_text(encoding="utf-8")
    assert "<address>127.0.0.1</address>" in profile
    assert "<useBuiltinTransports>false</useBuiltinTransports>" in profile
    assert "<type>SHM</type>" not in profile


@pytest.mark.parametrize(
    ("name", "value", "after"),
    [(RANGE, "SUBNET", ("SUBNET", None)), (PROFILES, "own.xml", ("LOCALHOST", "own.xml"))],
)
def test_what_the_user_has_set_stays(
    bare: pytest.MonkeyPatch, tmp_path: Path, name: str, value: str, after: tuple[str, str | None]
) -> None:
    bare.setenv(name, value)
    set_process_environment(7, tmp_path)
    assert (os.environ[RANGE], os.environ.get(PROFILES)) == after
