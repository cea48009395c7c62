"""This process, as what it makes will name it."""

import platform
import secrets
import socket
from datetime import UTC, datetime

from winding_cli.doctor.installation import version_of
from winding_reports.records.identity import LIBRARIES, Origin

# Wheels of PyPI and packages of ROS call the same module differently; so do pip and colcon.
_DISTRIBUTIONS = {"rclpy": ("ros-jazzy-rclpy", "rclpy")}
_PROJECT = ("cable-winding-twin", "winding_cli")


def origin_here(began: datetime | None = None) -> Origin:
    """Return the origin of what this process makes, from a moment on; from now on without one."""
    began = began or datetime.now(UTC)
    return Origin(
        run_id=f"{began:%Y%m%dT%H%M%SZ}-{secrets.token_hex(4)}",
        began=began,
        project_version=_version(*_PROJECT),
        versions={
            name: platform.python_version()
            if name == "python"
            else _version(*_DISTRIBUTIONS.get(name, (name,)))
            for name in LIBRARIES
        },
        host=socket.gethostname(),
    )


def _version(*distributions: str) -> str:
    return next(filter(None, map(version_of, distributions)), "")
