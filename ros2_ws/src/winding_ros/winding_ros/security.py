"""DDS security: a refusal to run open when asked not to."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from winding_ros.access_policy import Participants
from winding_ros.environment import enclave
from winding_ros.topics import ORCHESTRATOR

_ENCLAVE_FILES = ("cert.pem", "key.pem", "governance.p7s", "permissions.p7s")
_TRIAL = """
import sys, rclpy
rclpy.init(args=["trial", "--ros-args", "--enclave", sys.argv[1]])
rclpy.create_node("security_trial").destroy_node()
rclpy.shutdown()
"""
_TRIAL_TIMEOUT = 60.0


class SecurityError(ValueError):
    """The graph cannot be run with security."""


def check_security(
    namespace: str,
    environment: Mapping[str, str] = os.environ,
    taking_part: Participants = Participants(),  # noqa: B008
) -> None:
    """Refuse unless every process of a run would authenticate and encrypt.

    Args:
        namespace: Of the graph.
        environment: Of the process.
        taking_part: Nodes and others of the run.

    Raises:
        SecurityError: A setting, a key or the middleware's security is missing.
    """
    for name, wanted in (("ROS_SECURITY_ENABLE", "true"), ("ROS_SECURITY_STRATEGY", "Enforce")):
        if environment.get(name) != wanted:
            raise SecurityError(
                f"a secure run needs {name}={wanted}, got {environment.get(name) or 'nothing'}"
            )
    keystore = environment.get("ROS_SECURITY_KEYSTORE", "")
    if not keystore or not Path(keystore).is_dir():
        raise SecurityError(
            f"a secure run needs ROS_SECURITY_KEYSTORE, got {keystore or 'nothing'}: no such folder"
        )
    for node in taking_part.enclaves:
        folder = Path(keystore) / "enclaves" / namespace / node
        missing = [name for name in _ENCLAVE_FILES if not (folder / name).is_file()]
        if missing:
            raise SecurityError(
                f"the keystore has no {missing[0]} in {folder}; `winding graph --sros2` prints the "
                "policy of a run"
            )
    _try_middleware(enclave(namespace, ORCHESTRATOR), environment)


def _try_middleware(name: str, environment: Mapping[str, str]) -> None:
    """Make one node under the enclave in a process of its own; a library may end the process."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _TRIAL, name],
            env=dict(environment),
            capture_output=True,
            text=True,
            timeout=_TRIAL_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise SecurityError(
            f"no node came up under enclave {name} in {_TRIAL_TIMEOUT:g} s"
        ) from None
    if done.returncode != 0:
        lines = [line for line in (done.stderr + done.stdout).splitlines() if "[INFO]" not in line]
        reason = [line for line in lines if "ecurity" in line]
        raise SecurityError(
            f"the middleware makes no node under enclave {name}: "
            + (reason[0].strip() if reason else f"exit code {done.returncode}")
        )
