"""Run one node as a process."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from cable_winding.parameters import ParameterError

EXIT_REFUSED = 2
# Set by the orchestrator: a supervised node ends with its supervisor.
SUPERVISED = "WINDING_SUPERVISED"
_PR_SET_PDEATHSIG = 1


def run_node(factory: Callable[[], Node]) -> int:
    """Spin a node until it is told to stop; return the exit code.

    A parameter that is refused ends the process with code 2 and one sentence on stderr.
    """
    if os.environ.get(SUPERVISED) and sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    rclpy.init(args=sys.argv)
    try:
        node = factory()
    except ParameterError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        rclpy.try_shutdown()
        return EXIT_REFUSED
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
