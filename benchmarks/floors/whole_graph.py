"""A recorded run of a checkout's graph at speed 1, and the processor time of its steady state."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import psutil

from floors.processor_time import Cost, cost_between, spent

CASE = 4
# Of the run: the start is behind, the end not yet begun.
STEADY = (0.25, 0.9)
NODES = ("winding_rig_node", "cable_fem_node", "marker_tracker_node", "correction_node")
_LOOK_PERIOD = 0.01
_PROGRESS = re.compile(r"([0-9.]+) of [0-9.]+ s simulated")


def warm_up(checkout: Path, folder: Path) -> None:
    """Wind for a moment, so that all machine code of a checkout has been made."""
    _wound(checkout, folder, 1.0)


def wind(checkout: Path, folder: Path, duration: float) -> Cost:
    """Wind case 4 with a bag, by the command of a checkout.

    The command prints every other second how far simulated time has come; those instants are the
    ends of what is measured.

    Args:
        checkout: Folder with `ros2_ws`.
        folder: New; receives the bag in `bag`.
        duration: Simulated [s].

    Raises:
        RuntimeError: The run failed, or did not say how far it was.
    """
    instants, names = _wound(checkout, folder, duration)
    low, high = (share * duration for share in STEADY)
    steady = [instant for instant in instants if low <= instant[0] <= high]
    if not steady or steady[-1][0] - steady[0][0] < 0.4 * duration:
        raise RuntimeError(f"the run printed its progress too rarely: {[t for t, _ in instants]}")
    (begin, before), (end, after) = steady[0], steady[-1]
    return cost_between(before, after, end - begin, names)


def _wound(
    checkout: Path, folder: Path, duration: float
) -> tuple[list[tuple[float, dict[int, float]]], dict[int, str]]:
    """Return (simulated time [s], `spent` then) at each progress, and the processes' names."""
    folder.mkdir()
    sources = sorted((checkout / "ros2_ws" / "src").iterdir())
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sources))}
    # Only tests have message classes check their fields.
    environment.pop("ROS_PYTHON_CHECK_FIELDS", None)
    command = [
        *(sys.executable, "-m", "winding_cli.cli", "run", "--case", str(CASE), "--speed", "1"),
        *("--duration-s", str(duration), "--bag", str(folder / "bag")),
        *("--output", str(folder / "run")),
    ]
    output = folder / "output"
    with output.open("w") as out:
        run = subprocess.Popen(
            command, env=environment, cwd=folder, stdout=out, stderr=subprocess.STDOUT
        )
    instants: list[tuple[float, dict[int, float]]] = []
    names: dict[int, str] = {}
    root = psutil.Process(run.pid)
    try:
        while run.poll() is None:
            found = _PROGRESS.findall(output.read_text())
            if found and (not instants or float(found[-1]) != instants[-1][0]):
                instants.append((float(found[-1]), spent(root)))
                names = names or _names(root)
            time.sleep(_LOOK_PERIOD)
    finally:
        run.kill()
        run.wait()
    if run.returncode != 0:
        raise RuntimeError(f"the run of {checkout} failed:\n{output.read_text()}")
    return instants, names


def _names(root: psutil.Process) -> dict[int, str]:
    names = {root.pid: "orchestrator"}
    for process in root.children(recursive=True):
        words = process.cmdline()
        names[process.pid] = next((node for node in NODES if node in words), "other")
    return names
