"""Isolation of tests and benchmarks: a DDS domain per process, nothing of the caller's shell."""

import contextlib
import os
import signal
import tempfile
from pathlib import Path

import pytest
from domain_coordinator import domain_id

import winding_ros

# Two workers share two cores: a library that starts a thread for each would halve both.
for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")
PROFILE = Path(winding_ros.__file__).parent / "profiles" / "loopback.xml"
_DOMAIN = contextlib.ExitStack()


def pytest_configure(config: pytest.Config) -> None:
    # A suite in the background of a shell is told to ignore Ctrl-C, and so is what it starts.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # rcl reads these when a context is made, so they are set before any test imports rclpy.
    # The coordinator gives no domain to two test processes of this machine.
    os.environ["ROS_DOMAIN_ID"] = str(_DOMAIN.enter_context(domain_id()))
    # As the graph's own processes find and hear each other.
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(PROFILE)
    os.environ["ROS_LOG_DIR"] = tempfile.mkdtemp(prefix="winding-test-log-")
    # Generated message classes check types and ranges only when they are asked to.
    os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"


def pytest_unconfigure(config: pytest.Config) -> None:
    _DOMAIN.close()
