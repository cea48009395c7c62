"""The graph's traffic without its work: who sends what how often to whom, and what that takes."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import psutil

from floors.processor_time import Cost, cost_between, spent
from floors.whole_graph import STEADY
from winding_recorder.bags.reading import messages_of, opened
from winding_ros import topics
from winding_ros.graph import GRAPH
from winding_ros.runtime.heartbeat import PERIOD, heartbeat_topic
from winding_ros.runtime.inputs import LOOK_PERIOD
from winding_ros.topic import Topic

PROGRAM = Path(__file__).with_name("bare_process.py")
# The process of recorder and supervision.
ORCHESTRATOR = topics.ORCHESTRATOR
# As the graph wakes up: the machine and the tracker with each frame, the others as they look.
FRAME_PERIOD = 1.0 / 200.0
# CDR of a std_msgs/Header without a frame's name.
HEADER = b"\x00\x01\x00\x00" + bytes(8) + b"\x01\x00\x00\x00\x00"

Plan = dict[str, dict[str, Any]]


def plan_of(bag: Path, duration: float, stored: Path) -> Plan:
    """Return what each process of the graph sends and takes, as a recorded run shows it.

    Every topic comes at the rate and, its median message byte for byte, at the size of the run.

    Args:
        bag: Of that run.
        duration: Of that run, simulated [s].
        stored: Where the bare recorder stores.

    Raises:
        RuntimeError: The recording has nothing of the machine's steady state.
    """
    found: dict[str, list[bytes]] = defaultdict(list)
    counts: dict[str, int] = defaultdict(int)
    with opened(bag) as reader:
        begin, end = (reader.start_time + share * duration * 1e9 for share in STEADY)
        for link, stamp, data in messages_of(reader, reader.connections):
            counts[link.topic] += 1
            sizes = found[link.topic]
            # Pictures are all of one size.
            if begin <= stamp <= end and (len(data) < 20_000 or not sizes):
                sizes.append(data)
    processes = [*(spec.name for spec in GRAPH), ORCHESTRATOR]
    plan: Plan = {
        name: {
            "period": FRAME_PERIOD if name in (topics.RIG, topics.TRACKER) else LOOK_PERIOD,
            "bag": str(stored) if name == ORCHESTRATOR else "",
            "sends": [],
            "takes": [],
        }
        for name in processes
    }

    def connect(
        name: str, type_: str, depth: int, senders: list[str], readers: list[str], rate: float,
        data: bytes,
    ) -> None:  # fmt: skip
        item = {"topic": name, "type": type_, "depth": depth}
        for sender in senders:
            sends = {"rate": rate / len(senders), "readers": len(readers)}
            plan[sender]["sends"].append(item | sends | {"data": base64.b64encode(data).decode()})
        for reader in readers:
            plan[reader]["takes"].append(item)

    for topic in topics.TOPICS:
        name = next((full for full in found if full.endswith(topic.name)), None)
        if name is None or not found[name]:
            continue
        data = sorted(found[name], key=len)[len(found[name]) // 2]
        connect(
            name, topic.type_name, topic.depth, _senders(topic, processes), _readers(topic),
            counts[name] / duration, data,
        )  # fmt: skip
    if not plan[topics.RIG]["sends"]:
        raise RuntimeError(f"nothing of the steady state is in {bag}")
    progress = topics.RECORDER_PROGRESS
    assert progress.rate is not None
    connect(
        f"/{progress.name}", progress.type_name, progress.depth, [ORCHESTRATOR], [topics.RIG],
        progress.rate, HEADER,
    )  # fmt: skip
    nodes = processes[:-1]
    for name in processes:
        readers = nodes if name == ORCHESTRATOR else [ORCHESTRATOR]
        header = topics.RECORDER_PROGRESS.type_name
        connect(f"/{heartbeat_topic(name)}", header, 1, [name], readers, 1.0 / PERIOD, HEADER)
    return plan


def _senders(topic: Topic, processes: list[str]) -> list[str]:
    return processes if topic.publisher == topics.EVERY_NODE else [topic.publisher]


def _readers(topic: Topic) -> list[str]:
    readers = [spec.name for spec in GRAPH if topic in spec.subscribes]
    if topic is topics.CLOCK:
        readers += [spec.name for spec in GRAPH if spec.name != topics.RIG]
    # Everything in the bag has come to the recorder.
    return [*readers, ORCHESTRATOR]


def carry(plan: Plan, folder: Path, duration: float) -> Cost:
    """Run the processes of a plan for a while.

    Args:
        plan: See `plan_of`.
        folder: New; for the plan and the recording.
        duration: Of the traffic [s].

    Raises:
        RuntimeError: Messages were lost, or a process failed.
    """
    folder.mkdir()
    file = folder / "plan.json"
    file.write_text(json.dumps(plan), encoding="utf-8")
    running = {
        name: subprocess.Popen(
            [sys.executable, str(PROGRAM), str(file), name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for name in plan
    }
    try:
        for name, process in running.items():
            assert process.stdout is not None
            if process.stdout.readline() != "ready\n":
                raise RuntimeError(f"bare process {name} did not begin")
        _write(running, "go")
        began = time.monotonic()
        ends = []
        for share in STEADY:
            time.sleep(max(0.0, began + share * duration - time.monotonic()))
            times = {}
            for process in running.values():
                times |= spent(psutil.Process(process.pid))
            ends.append((time.monotonic(), times))
        (start, before), (stop, after) = ends
        _write(running, "end")
        counted = {name: json.loads(process.communicate()[0]) for name, process in running.items()}
    finally:
        for process in running.values():
            process.kill()
            process.wait()
    _require_all_arrived(plan, counted)
    names = {process.pid: name for name, process in running.items()}
    return cost_between(before, after, stop - start, names)


def _write(running: dict[str, subprocess.Popen[str]], word: str) -> None:
    for process in running.values():
        assert process.stdin is not None
        process.stdin.write(f"{word}\n")
        process.stdin.flush()


def _require_all_arrived(plan: Plan, counted: dict[str, Any]) -> None:
    """Refuse traffic that did not take place."""
    sent: dict[str, int] = defaultdict(int)
    for answers in counted.values():
        for topic, count in answers["sent"].items():
            sent[topic] += count
    for name, item in plan.items():
        for wanted in item["takes"]:
            topic = wanted["topic"]
            came = counted[name]["taken"][topic]
            # A heartbeat's history is one message, as in the graph.
            if came < 0.98 * sent[topic] - 2.0:
                raise RuntimeError(f"{name} took {came} of {sent[topic]} messages on {topic}")
