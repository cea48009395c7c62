"""One of the two processes of the doctor's exchange: `answer` sends back what `ask` sends."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import Header

from winding_ros.environment import set_process_environment
from winding_ros.runtime.process import SUPERVISED, end_with_supervisor

_COUNT = 20
_RESEND = 0.5
# A stranger's node names are asked for again at its heartbeat, every 3 s by default.
_ACQUAINTANCE = 4.0
_QOS = QoSProfile(depth=_COUNT)


def _spin_until(node: Node, reached: Callable[[], bool], end: float) -> bool:
    """Spin until something holds, or to a monotonic time [s]; return whether it holds."""
    while not reached():
        if time.monotonic() > end:
            return False
        rclpy.spin_once(node, timeout_sec=0.05)
    return True


def _answer(node: Node, key: str, patience: float) -> None:
    publisher = node.create_publisher(Header, f"doctor/{key}/answer", _QOS)
    node.create_subscription(Header, f"doctor/{key}/ask", publisher.publish, _QOS)
    with contextlib.suppress(ExternalShutdownException):
        _spin_until(node, lambda: False, time.monotonic() + patience)


def _ask(node: Node, key: str, patience: float) -> dict[str, object]:
    begin = time.monotonic()
    end = begin + patience
    answers: list[str] = []
    publisher = node.create_publisher(Header, f"doctor/{key}/ask", _QOS)
    subscription = node.create_subscription(
        Header, f"doctor/{key}/answer", lambda message: answers.append(message.frame_id), _QOS
    )
    times: list[float] = []
    refusal = ""
    if _spin_until(
        node,
        lambda: (
            publisher.get_subscription_count() > 0
            and node.count_publishers(subscription.topic_name) > 0
        ),
        end,
    ):
        while len(times) < _COUNT and time.monotonic() < end:
            # What is sent before the other side has matched is lost, and sent again.
            number, sent = str(len(times)), time.monotonic()
            publisher.publish(Header(frame_id=number))
            if _spin_until(node, lambda: number in answers, min(sent + _RESEND, end)):  # noqa: B023
                times.append(time.monotonic() - sent)
        if len(times) < _COUNT:
            refusal = f"no answer in {patience:g} s"
        else:
            _spin_until(node, lambda: False, begin + _ACQUAINTANCE)
    else:
        refusal = f"two processes do not find each other in {patience:g} s"
    names = {
        f"{namespace.rstrip('/')}/{name}"
        for name, namespace in node.get_node_names_and_namespaces()
        if not name.startswith("doctor_")
    }
    return {"round_trips": times, "strangers": sorted(names), "refusal": refusal}


def _main(domain: str, logs: str, key: str, patience: str, role: str) -> None:
    set_process_environment(int(domain), Path(logs))
    os.environ[SUPERVISED] = str(os.getppid())
    middleware = get_rmw_implementation_identifier()
    rclpy.init()
    node = Node(f"doctor_{role}_{key}", enable_rosout=False, start_parameter_services=False)
    end_with_supervisor()
    record = {}
    if role == "answer":
        _answer(node, key, float(patience))
    else:
        record = {"middleware": middleware, **_ask(node, key, float(patience))}
    if rclpy.ok():
        node.destroy_node()
    rclpy.try_shutdown()
    if record:
        print(json.dumps(record), flush=True)


if __name__ == "__main__":
    _main(*sys.argv[1:])
