"""One process of the bare traffic: sends bytes, takes bytes, and does nothing with them.

Run as `python bare_process.py PLAN NAME`. It prints "ready" when every reader listens to it, begins
at the first line of standard input, ends at the second, and prints how many messages it has sent
and taken by topic.
"""

from __future__ import annotations

import base64
import importlib
import json
import select
import sys
import time
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

PATIENCE, LINGER = 60.0, 0.5
CHUNK_BYTES = 256 * 1024


def message_class(name: str) -> Any:
    """Return the class of a type such as sensor_msgs/msg/Image."""
    package, kind, title = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), title)


def quality(depth: int) -> QoSProfile:
    """Return what all topics of the graph have but for their depth."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=depth, reliability=ReliabilityPolicy.RELIABLE
    )


class Storage:
    """Messages into an MCAP file as the library writes it: uncompressed chunks with checksums."""

    def __init__(self, path: str, takes: list[dict[str, Any]]) -> None:
        from mcap.writer import CompressionType, Writer

        self._file = Path(path).open("wb", buffering=0)  # noqa: SIM115 - closed in `close`
        self._writer = Writer(
            self._file,
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.NONE,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._writer.start(profile="ros2", library="bare")
        self._channels = {
            item["topic"]: self._writer.register_channel(
                item["topic"], "cdr", self._writer.register_schema(item["type"], "ros2msg", b"")
            )
            for item in takes
        }

    def add(self, topic: str, data: bytes, number: int) -> None:
        """Store a message."""
        now = time.time_ns()
        self._writer.add_message(self._channels[topic], now, data, now, number)

    def close(self) -> None:
        """End the file."""
        self._writer.finish()
        self._file.close()


def main() -> None:
    """Send and take until the second line."""
    plan = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))[sys.argv[2]]
    rclpy.init()
    node = Node(sys.argv[2], enable_rosout=False, start_parameter_services=False)
    sent = []
    for item in plan["sends"]:
        type_ = message_class(item["type"])
        publisher = node.create_publisher(type_, item["topic"], quality(item["depth"]))
        sent.append([publisher, item["rate"], base64.b64decode(item["data"]), 0, item["readers"]])
    taken = []
    for item in plan["takes"]:
        type_ = message_class(item["type"])
        subscription = node.create_subscription(
            type_, item["topic"], lambda message: None, quality(item["depth"]), raw=True
        )
        taken.append([subscription.handle, type_, item["topic"], 0])
    storage = Storage(plan["bag"], plan["takes"]) if plan["bag"] else None
    end = time.monotonic() + PATIENCE
    while any(publisher.get_subscription_count() < readers for publisher, *_, readers in sent):
        if time.monotonic() > end:
            sys.exit(f"{sys.argv[2]}: no subscription was found")
        time.sleep(0.05)
    print("ready", flush=True)
    sys.stdin.readline()

    begin = due = time.monotonic()
    while not select.select([sys.stdin], [], [], 0.0)[0]:
        due += plan["period"]
        time.sleep(max(0.0, due - time.monotonic()))
        passed = time.monotonic() - begin
        for entry in sent:
            publisher, rate, data, count, _ = entry
            for _ in range(count, int(passed * rate)):
                publisher.publish(data)
                entry[3] += 1
        take(taken, storage)
    # Whoever stopped a moment later has sent something in the meantime.
    end = time.monotonic() + LINGER
    while time.monotonic() < end:
        time.sleep(plan["period"])
        take(taken, storage)
    if storage is not None:
        storage.close()
    print(
        json.dumps({"sent": {e[0].topic_name: e[3] for e in sent}, "taken": dict(counted(taken))})
    )
    rclpy.shutdown()


def take(taken: list[list[Any]], storage: Storage | None) -> None:
    """Take everything that waits."""
    for entry in taken:
        handle, type_, topic, _ = entry
        while (message := handle.take_message(type_, True)) is not None:
            entry[3] += 1
            if storage is not None:
                storage.add(topic, message[0], entry[3])


def counted(taken: list[list[Any]]) -> list[tuple[str, int]]:
    """Return (topic, count) of what was taken."""
    return [(topic, count) for _, _, topic, count in taken]


if __name__ == "__main__":
    main()
