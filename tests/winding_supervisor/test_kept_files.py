"""What a run keeps of its nodes: logs that have a bound, and traces."""

import asyncio
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from winding_core.trace import TRACE_DTYPE, Channel, Station, TraceEvent
from winding_ros import topics
from winding_ros.graph import GRAPH
from winding_ros.messages.clouds import encode_cloud
from winding_supervisor.processes.node_process import LOG_LIMIT, NodeProcess
from winding_supervisor.session.run_parts import TraceRecording
from winding_supervisor.watch.event_log import FILE_LIMIT, EventLog, read_events

CHUNK = 65_536
LINES = """
import sys
for k in range(300_000):
    sys.stdout.write(f"[ERROR] [node]: the same complaint for the {k}th time, and no end of it\\n")
"""
ONE_LINE = """
import sys
for k in range(300):
    sys.stdout.write("complaint " * 10_000)
sys.stdout.write("\\n[ERROR] [node]: the last word")
"""


KILLED = """
import os
print("[ERROR] [node]: long ago", flush=True)
os.kill(os.getpid(), 9)
"""


def run(folder: Path, source: str) -> tuple[int, str, int]:
    """Return (exit code, last complaint, bytes left on the disk) of a process."""
    (folder / "shouting.py").write_text(source)
    logs = folder / "log"
    logs.mkdir()
    process = NodeProcess(
        replace(GRAPH[0], package="shouting"),
        [],
        os.environ | {"PYTHONPATH": str(folder)},
        logs / "shouting.log",
    )

    async def until_the_end() -> int:
        await process.start()
        await process.ended()
        return await process.stop()

    code = asyncio.run(asyncio.wait_for(until_the_end(), 120.0))
    return code, process.complaint(), sum(file.stat().st_size for file in logs.iterdir())


def test_complaints_without_end_are_kept_short(tmp_path: Path) -> None:
    code, complaint, size = run(tmp_path, LINES)
    assert (code, complaint) == (0, "the same complaint for the 299999th time, and no end of it")
    assert LOG_LIMIT // 2 < size <= 2 * LOG_LIMIT + CHUNK


def test_a_line_without_end_neither_holds_the_node_up_nor_fills_memory(tmp_path: Path) -> None:
    code, complaint, size = run(tmp_path, ONE_LINE)
    assert (code, complaint) == (0, "the last word")
    assert size <= 2 * LOG_LIMIT + CHUNK


def test_events_without_end_are_kept_short(tmp_path: Path) -> None:
    log = EventLog(file=tmp_path / "events.jsonl")
    for k in range(25_000):
        log.note("restarted", "marker_tracker", "active again " * 8, t=float(k), wall=float(k))
    sizes = {file.name: file.stat().st_size for file in tmp_path.iterdir()}
    assert set(sizes) == {"events.jsonl", "events.jsonl.1"}
    # One event more than the limit is written before it is noticed.
    assert max(sizes.values()) <= FILE_LIMIT + 300
    assert read_events(tmp_path / "events.jsonl")[-1] == log.events[-1]
    assert len(log.events) <= 10_000


@pytest.mark.processes
def test_a_run_writes_no_log_but_those_with_a_bound(recorded_run: Any) -> None:
    """ROS' own log files have no bound; the nodes' output has the same content and a bound."""
    (run_folder,) = (recorded_run.bag.parent / "runs").iterdir()
    left = {file.name for file in (run_folder / "log").iterdir()}
    bounded = {f"{spec.name}.{suffix}" for spec in GRAPH for suffix in ("log", "yaml")}
    assert left <= bounded


def test_output_of_a_killed_process_is_not_why_it_ended(tmp_path: Path) -> None:
    assert run(tmp_path, KILLED)[:2] == (-9, "")


class Bench:
    """A recording, and a node that notes."""

    def __init__(self, ros: Any) -> None:
        node, self.ros = ros.plain(), ros
        self.publisher = topics.TRACE.advertise(node)
        self.recording = TraceRecording(ros.plain("recorder_host"))
        ros.spin_until(lambda: self.publisher.get_subscription_count() == 1)

    def note(self, **fields: float) -> None:
        """Note a frame that was taken now, odd in some fields."""
        record = np.zeros(1, TRACE_DTYPE)
        record["event"], record["channel"] = TraceEvent.TAKEN, Channel.FRAME
        record["station"] = Station.TRACKER
        record["began"] = record["ended"] = time.time()
        for name, value in fields.items():
            record[name] = value
        self.publisher.publish(encode_cloud(0.0, record))

    def stamps(self, since: int, count: int) -> list[float]:
        """Return the stamps of the records since a monotonic time [ns], once there are so many."""
        self.ros.spin_until(lambda: len(self.recording.since(0)) == count)
        return [float(stamp) for stamp in self.recording.since(since)["stamp"]]


@pytest.fixture
def bench(ros: Any) -> Bench:
    return Bench(ros)


def test_an_earlier_run_of_the_same_nodes_is_left_out(bench: Bench) -> None:
    # An operator's next run begins at simulated time 0 again, or goes on.
    bench.note(stamp=1.0, began=time.time() - 60.0, ended=time.time() - 59.0)
    bench.note(stamp=2.0)
    assert bench.stamps(time.monotonic_ns() - 30_000_000_000, 2) == [2.0]


@pytest.mark.parametrize("odd", [{"event": 9}, {"channel": 9}, {"station": 4}, {"began": np.nan}])
def test_an_invalid_record_is_left_out(bench: Bench, odd: dict[str, float]) -> None:
    bench.note(stamp=1.0, **odd)
    bench.note(stamp=2.0)
    assert bench.stamps(0, 1) == [2.0]
