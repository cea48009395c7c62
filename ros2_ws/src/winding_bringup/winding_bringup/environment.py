"""What surrounds the graph's processes: discovery, logs, shared memory, name remapping."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from cable_winding.ros.process import SUPERVISED
from winding_bringup.graph import DEFAULT_NAMESPACE

LOG_FORMAT = "[{severity}] [{name}]: {message}"
_CAMERA_PROFILE = Path(__file__).parent / "profiles" / "camera.xml"


def set_process_environment(domain: int, log_directory: Path) -> None:
    """Set what rcl reads when a process joins the graph; children inherit it."""
    log_directory.mkdir(parents=True, exist_ok=True)
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["ROS_LOG_DIR"] = str(log_directory)
    os.environ["RCUTILS_CONSOLE_OUTPUT_FORMAT"] = LOG_FORMAT


def child_environment(*, camera: bool) -> dict[str, str]:
    """Return the environment of a node's process.

    Args:
        camera: Whether the node publishes frames and needs a large shared-memory segment.
    """
    environment = dict(os.environ)
    environment[SUPERVISED] = "1"
    # One node, one core: the graph has more processes than the machine has processors.
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        environment.setdefault(name, "1")
    if camera and environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST":
        environment.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(_CAMERA_PROFILE))
    return environment


def ros_arguments(namespace: str) -> list[str]:
    """Return the ROS arguments that place a process in a namespace; none for an empty one.

    A graph outside the default namespace gets a clock of its own, so that two graphs can share
    a domain.
    """
    if not namespace:
        return []
    arguments = ["-r", f"__ns:=/{namespace}"]
    if namespace != DEFAULT_NAMESPACE:
        arguments += ["-r", f"/clock:=/{namespace}/clock"]
    return ["--ros-args", *arguments]


def clean_shared_memory() -> None:
    """Remove shared-memory files that killed processes left behind; live ones stay."""
    tool = Path(sys.prefix) / "bin" / "fastdds"
    if tool.exists():
        subprocess.run([str(tool), "shm", "clean"], capture_output=True, check=False, timeout=60)
