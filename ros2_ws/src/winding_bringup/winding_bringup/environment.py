"""What surrounds the graph's processes: discovery, logs, shared memory, name remapping."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from cable_winding.ros.process import SUPERVISED
from winding_bringup.graph import DEFAULT_NAMESPACE

LOG_FORMAT = "[{severity}] [{name}]: {message}"
_PROFILES_FILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
_CAMERA_PROFILE = Path(__file__).parent / "profiles" / "camera.xml"
_NODE_PROFILE = Path(__file__).parent / "profiles" / "node.xml"


def set_process_environment(domain: int, log_directory: Path) -> None:
    """Set what rcl reads when a process joins the graph; children inherit it."""
    log_directory.mkdir(parents=True, exist_ok=True)
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST":
        # A profile of the user's own stays.
        os.environ.setdefault(_PROFILES_FILE, str(_NODE_PROFILE))
    os.environ["ROS_LOG_DIR"] = str(log_directory)
    os.environ["RCUTILS_CONSOLE_OUTPUT_FORMAT"] = LOG_FORMAT


def child_environment(*, camera: bool) -> dict[str, str]:
    """Return the environment of a node's process.

    Args:
        camera: Whether the node publishes frames and needs a large shared-memory segment.
    """
    environment = dict(os.environ)
    environment[SUPERVISED] = str(os.getpid())
    # One node, one core: the graph has more processes than the machine has processors.
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        environment.setdefault(name, "1")
    if environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST":
        present = environment.get(_PROFILES_FILE, str(_NODE_PROFILE))
        own = present != str(_NODE_PROFILE)
        profile = present if own else str(_CAMERA_PROFILE if camera else _NODE_PROFILE)
        environment[_PROFILES_FILE] = profile
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


def enclave_arguments(namespace: str, node: str) -> list[str]:
    """Return the ROS arguments that name a process' enclave; none where DDS security is off."""
    if os.environ.get("ROS_SECURITY_ENABLE") != "true":
        return []
    return ["--ros-args", "--enclave", enclave(namespace, node)]


def enclave(namespace: str, node: str) -> str:
    """Return the enclave of a node's process: its keys and permissions in the keystore."""
    return f"/{namespace}/{node}"


def clean_shared_memory() -> None:
    """Remove shared-memory files that killed processes left behind; live ones stay."""
    tool = Path(sys.prefix) / "bin" / "fastdds"
    if tool.exists():
        subprocess.run([str(tool), "shm", "clean"], capture_output=True, check=False, timeout=60)
