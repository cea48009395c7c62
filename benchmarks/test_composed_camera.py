"""A camera in the tracker's process at the paper's rate: 1,000 frames a second beside all nodes."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.run_spec import RunSpec
from winding_ros import topics
from winding_ros.graph import GraphError
from winding_supervisor.machines.external_machine import ExternalMachineConfig
from winding_supervisor.session.run import opened_run
from winding_supervisor.session.run_config import RunConfig

CELLS = Path(__file__).parents[1] / "tests" / "winding_supervisor"
DURATION, RATE = 10.0, 1000.0
NAMESPACE = "benchmark"


@pytest.mark.timeout(1200)
def test_a_thousand_frames_a_second(
    bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera, film = CELLS / "film_camera.py", tmp_path / "film.npy"
    subprocess.run([sys.executable, str(camera), str(film), str(DURATION), str(RATE)], check=True)
    monkeypatch.setenv("WINDING_FILM", str(film))
    cell = subprocess.Popen(
        [
            *(sys.executable, str(CELLS / "camera_cell.py")),
            json.dumps({"frame_rate": 0.0, "joint_rate": RATE}),
            *("--ros-args", "-r", f"__ns:=/{NAMESPACE}"),
        ],
        stderr=subprocess.PIPE,
        text=True,
    )
    condition = Condition(case=4, duration=DURATION)
    drive = condition.resolved().drive
    asked = {
        "case": 4,
        "duration_s": DURATION,
        "namespace": NAMESPACE,
        "machine": "external",
        "bag": tmp_path / "bag",
        "compose": f"{camera}:open_camera",
    }
    config = RunConfig(
        spec=RunSpec.from_cell(None, asked),
        directory=tmp_path / "run",
        machine=ExternalMachineConfig(
            axes=MachineAxes(),
            drive=drive,
            end_angle=float(drive.positions(DURATION - 0.5)[0]),
            camera=True,
            starts_itself=False,
            standing_limit=60.0,
        ),
    )
    assert cell.stderr is not None
    try:
        assert any("ready" in line for line in cell.stderr)
        with opened_run(config) as run:
            run.wind(lambda buffer, wall: None, print, lambda result: None)
            (result,) = run.remains()
    except GraphError as error:
        # A slow machine falls behind until supervision hears nothing; all else is a fault.
        if "silent" not in str(error):
            raise
        pytest.skip(f"this machine does not hold {RATE:g} frames/s beside all nodes: {error}")
    finally:
        cell.kill()
        cell.wait()
        film.unlink()
    buffer = result.buffer
    frames = buffer.messages[topics.CAMERA_INFO.name]
    sent = {message.stamp_ns: message.sent_ns for message in frames}
    came = {
        message.stamp_ns: message.received_ns
        for message in buffer.messages[topics.TRACKED_MARKERS.name]
    }
    both = sorted(sent.keys() & came.keys())
    latency = np.array([came[stamp] - sent[stamp] for stamp in both]) * 1e-6
    stamps = buffer.stamps(topics.CAMERA_INFO)
    answered = buffer.stamps(topics.TRACKED_MARKERS)
    seconds = (stamps[-1] - stamps[0]) * 1e-9
    bench.row("composed_frames_per_s", len(answered) / seconds, "frames/s")
    bench.row("composed_frames_lost", len(np.setdiff1d(stamps, answered)), "frames", bar=0)
    bench.row("composed_latency_p50", float(np.percentile(latency, 50)), "ms")
    bench.row("composed_latency_p99", float(np.percentile(latency, 99)), "ms")
