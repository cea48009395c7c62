"""The graph of processes: what it keeps up with over DDS, beside all its nodes."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from winding_core.run_spec import RunSpec
from winding_ros import topics
from winding_supervisor.session.run import opened_run
from winding_supervisor.session.run_config import RunConfig

DURATION = 10.0
# What the computer itself adds: how late a thread that sleeps wakes up while nothing runs.
SLEEP, SLEEPS = 0.002, 2000
# A frame's camera_info is sent just before it; the buffer keeps no pictures.
FRAMES, MARKERS = topics.CAMERA_INFO.name, topics.TRACKED_MARKERS.name


def late() -> np.ndarray:
    """Return by how much sleeps are too long [ms]."""
    waits = []
    for _ in range(SLEEPS):
        began = time.perf_counter()
        time.sleep(SLEEP)
        waits.append(1e3 * (time.perf_counter() - began - SLEEP))
    return np.array(waits)


def test_windowed_frames_at_200_hz(bench: Any, tmp_path: Path) -> None:
    asked = {"case": 4, "duration_s": DURATION, "speed": 1.0, "namespace": "benchmark"}
    config = RunConfig(spec=RunSpec.from_cell(None, asked), directory=tmp_path / "run")
    asleep = late()
    with opened_run(config) as run:
        run.wind(lambda buffer, wall: None, print, lambda result: None)
        (result,) = run.remains()
    sent = {message.stamp_ns: message.sent_ns for message in result.buffer.messages[FRAMES]}
    came = {message.stamp_ns: message.received_ns for message in result.buffer.messages[MARKERS]}
    assert set(came) == set(sent)
    latency = np.array([came[stamp] - sent[stamp] for stamp in sent]) * 1e-6
    bench.row("live_frames_lost", int(DURATION * 200) + 1 - len(came), "frames", bar=0)
    bench.row("live_real_time_factor", DURATION / result.wall_s, "simulated s/s")
    bench.row("idle_wakeup_late_p99", float(np.percentile(asleep, 99)), "ms")
    bench.row("idle_wakeup_late_max", float(asleep.max()), "ms")
    bench.row("live_tracker_latency_p50", float(np.percentile(latency, 50)), "ms")
    bench.row("live_tracker_latency_p99", float(np.percentile(latency, 99)), "ms")
