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
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import Header

from winding_ros.environment import set_process_environment
from winding_ros.process import SUPERVISED, end_with_supervisor

_COUNT = 20
# A stranger's node names are asked for again at its heartbeat, every 3 s by default.
_ACQUAINTANCE = 4.0
_QOS = QoSProfile(depth=_COUNT)


class _LateError(Exception):
    """Something did not come in time."""


class _Side:
    """One of the two nodes, with its own context."""

    def __init__(self, name: str, patience: float) -> None:
        rclpy.init()
        self.node = Node(name, enable_rosout=False, start_parameter_services=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        end_with_supervisor()
        self._end = time.monotonic() + patience

    def spin_until(self, reached: Callable[[], bool], sentence: str) -> None:
        while not reached():
            if time.monotonic() > self._end:
                raise _LateError(sentence)
            self._executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()


def _answer(key: str, patience: float) -> None:
    side = _Side(f"doctor_answer_{key}", patience)
    publisher = side.node.create_publisher(Header, f"doctor/{key}/answer", _QOS)
    side.node.create_subscription(Header, f"doctor/{key}/ask", publisher.publish, _QOS)
    with contextlib.suppress(ExternalShutdownException, _LateError):
        side.spin_until(lambda: False, "nobody asked")
    side.close()


def _ask(key: str, patience: float) -> dict[str, object]:
    record: dict[str, object] = {"middleware": get_rmw_implementation_identifier()}
    side = _Side(f"doctor_ask_{key}", patience)
    begin = time.monotonic()
    heard: list[str] = []
    publisher = side.node.create_publisher(Header, f"doctor/{key}/ask", _QOS)
    answers = side.node.create_subscription(
        Header, f"doctor/{key}/answer", lambda message: heard.append(message.frame_id), _QOS
    )
    times = []
    try:
        side.spin_until(
            lambda: (
                publisher.get_subscription_count() > 0
                and side.node.count_publishers(answers.topic_name) > 0
            ),
            f"two processes do not find each other in {patience:g} s",
        )
        for number in range(_COUNT):
            sent = time.monotonic()
            while str(number) not in heard:
                # What was sent before the other side had matched is lost; nothing else is.
                publisher.publish(Header(frame_id=str(number)))
                resend = time.monotonic() + 0.5
                side.spin_until(
                    lambda: str(number) in heard or time.monotonic() > resend,  # noqa: B023
                    f"no answer in {patience:g} s",
                )
                if str(number) not in heard:
                    sent = time.monotonic()
            times.append(time.monotonic() - sent)
        side.spin_until(lambda: time.monotonic() > begin + _ACQUAINTANCE, "")
    except _LateError as late:
        record["refusal"] = str(late)
    names = {
        f"{namespace.rstrip('/')}/{name}"
        for name, namespace in side.node.get_node_names_and_namespaces()
        if not name.startswith("doctor_")
    }
    side.close()
    return record | {"round_trips": times, "strangers": sorted(names)}


def _main(domain: str, logs: str, key: str, patience: str, role: str) -> None:
    set_process_environment(int(domain), Path(logs))
    os.environ[SUPERVISED] = str(os.getppid())
    if role == "answer":
        _answer(key, float(patience))
    else:
        print(json.dumps(_ask(key, float(patience))), flush=True)


if __name__ == "__main__":
    _main(*sys.argv[1:])
