"""What surrounds the graph's processes: discovery, transport, logs, name remapping."""

import os
from pathlib import Path

from winding_ros.graph import DEFAULT_NAMESPACE
from winding_ros.runtime.process import SUPERVISED

LOG_FORMAT = "[{severity}] [{name}]: {message}"
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILES_FILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
_THIS_HOST = "LOCALHOST"
_LOOPBACK = Path(__file__).parent / "profiles" / "loopback.xml"


def set_process_environment(domain: int, log_directory: Path) -> None:
    """Set what rcl reads when a process joins the graph; children inherit it."""
    log_directory.mkdir(parents=True, exist_ok=True)
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    _keep_to_this_host()
    os.environ["ROS_LOG_DIR"] = str(log_directory)
    os.environ["RCUTILS_CONSOLE_OUTPUT_FORMAT"] = LOG_FORMAT


def _keep_to_this_host() -> None:
    """Leave discovery to the graph's own profile, unless the user has set a range or a profile."""
    if os.environ.setdefault(_RANGE, _THIS_HOST) == _THIS_HOST and _PROFILES_FILE not in os.environ:
        # With LOCALHOST rmw_fastrtps adds shared memory to the transports of any profile.
        os.environ[_RANGE] = "SYSTEM_DEFAULT"
        os.environ[_PROFILES_FILE] = str(_LOOPBACK)


def child_environment() -> dict[str, str]:
    """Return the environment of a node's process."""
    environment = dict(os.environ)
    environment[SUPERVISED] = str(os.getpid())
    # One node, one core: the graph has more processes than the machine has processors.
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        environment.setdefault(name, "1")
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
