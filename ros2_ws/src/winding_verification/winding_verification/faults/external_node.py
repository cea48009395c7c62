"""A node from outside the graph, as a process: external_node.py rogue|mismatch|late NAMESPACE."""

from __future__ import annotations

import sys
import time
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from winding_ros import topics
from winding_ros.messages.rig import encode_tension
from winding_ros.messages.stamps import serialised_stamp_ns
from winding_ros.runtime.process import end_with_supervisor

_RUN_OF_SAMPLES = 100


def main(role: str, namespace: str) -> None:
    """Play a role until killed, or until it is played; its first line of output is its report."""
    end_with_supervisor()
    rclpy.init(args=["external", "--ros-args", "-r", f"__ns:=/{namespace}"])
    node = Node(role)
    {"rogue": _rogue, "mismatch": _mismatch, "late": _late}[role](node)


def _report(text: object) -> None:
    print(text, flush=True)


def _rogue(node: Node) -> None:
    """Publish a second tension; report when the publisher was made, monotonic [s]."""
    publisher = topics.TENSION.advertise(node)
    _report(time.monotonic())
    node.create_timer(0.01, lambda: publisher.publish(encode_tension(0.0, 1.0e6)))
    rclpy.spin(node)


def _mismatch(node: Node) -> None:
    """Subscribe with a quality of service that is not offered; report when, monotonic [s]."""
    wanted = QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    node.create_subscription(
        topics.JOINT_STATES.type, topics.JOINT_STATES.name, lambda _message: None, wanted
    )
    _report(time.monotonic())
    rclpy.spin(node)


def _late(node: Node) -> None:
    """Read what is latched and what is live; report what came."""
    latched: list[Any] = []
    stamps: list[int] = []
    topics.FEM_PREDICTION.subscribe(node, latched.append)
    topics.JOINT_STATES.subscribe(
        node, lambda data: stamps.append(round(serialised_stamp_ns(data) / 1e6)), raw=True
    )
    while not (latched and len(stamps) >= _RUN_OF_SAMPLES):
        rclpy.spin_once(node, timeout_sec=0.1)
    first = stamps[0]
    whole = stamps[:_RUN_OF_SAMPLES] == list(range(first, first + _RUN_OF_SAMPLES))
    _report(
        f"got the prediction and {_RUN_OF_SAMPLES} encoder samples "
        + ("in a row" if whole else "with holes")
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
