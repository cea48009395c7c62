"""A second publisher of a topic or of signs of life is named, whoever it is."""

from typing import Any

import pytest

from winding_ros import topics
from winding_ros.runtime.heartbeat import Heartbeat, heartbeat_topic
from winding_supervisor.processes.discovery import RivalWatch


def test_one_publisher_each_is_nobody_s_rival(ros: Any) -> None:
    watcher, machine = ros.plain("watcher"), ros.plain("winding_rig")
    topics.JOINT_STATES.advertise(machine)
    Heartbeat(machine, topics.RIG)
    watch = RivalWatch(watcher, [topics.RIG])
    ros.spin_until(lambda: watcher.count_publishers(heartbeat_topic(topics.RIG)) == 1)
    assert watch.look(0.0) is None


@pytest.mark.parametrize("name", [topics.RIG, topics.ORCHESTRATOR])
def test_a_foreign_sign_of_life_is_named(ros: Any, name: str) -> None:
    watcher, own, foreign = ros.plain("watcher"), ros.plain(name), ros.plain("foreign")
    signs = [Heartbeat(node, name) for node in (own, foreign)]
    watch = RivalWatch(watcher, [topics.RIG])
    ros.spin_until(lambda: watch.look(0.0))
    both = ", ".join(sorted([f"/{name}", "/foreign"]))
    assert watch.look(0.0) == (f"{name}/heartbeat", f"has 2 publishers: {both}")
    del signs


def test_a_second_driver_is_named(ros: Any) -> None:
    watcher = ros.plain("watcher")
    publishers = [
        topics.JOINT_STATES.advertise(ros.plain(name)) for name in ("winding_rig", "foreign")
    ]
    watch = RivalWatch(watcher, [])
    ros.spin_until(lambda: watch.look(0.0))
    assert watch.look(0.0) == ("rig/joint_states", "has 2 publishers: /foreign, /winding_rig")
    del publishers


def test_the_successor_of_a_killed_node_is_no_rival_while_it_is_forgotten(ros: Any) -> None:
    watcher = ros.plain("watcher")
    nodes = [ros.plain("cable_fem") for _ in range(2)]
    publishers = [topics.FEM_MARKERS.advertise(node) for node in nodes]
    watch = RivalWatch(watcher, [])
    ros.spin_until(lambda: watcher.count_publishers(topics.FEM_MARKERS.name) == 2)
    assert watch.look(0.0) is None
    assert watch.look(9.0) is None
    contested = watch.look(11.0)
    assert contested is not None
    assert "has 2 publishers" in contested[1]
    del publishers
