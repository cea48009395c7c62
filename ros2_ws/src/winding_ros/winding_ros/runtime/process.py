"""Run one node as a process."""

import ctypes
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor

from winding_core.parameters import ParameterError
from winding_ros.runtime.managed_node import ManagedNode

EXIT_REFUSED = 2
# Set by the orchestrator to its process id: a supervised node ends with its supervisor.
SUPERVISED = "WINDING_SUPERVISED"
_PR_SET_PDEATHSIG = 1
# EventsExecutor.spin() of rclpy 7.1 never returns to the interpreter; spin_once does. A signal
# is served between two of them.
_SPIN_PERIOD = 0.05
# A thread that works beside the node lets its callbacks have the interpreter so soon [s]. Each
# kernel and each message gives it up; at Python's 5 ms a callback of 1 ms took up to 90.
_SWITCH_INTERVAL = 5.0e-4


def end_with_supervisor() -> None:
    """Let the kernel end this process with the one that supervises it; without one, nothing."""
    if os.environ.get(SUPERVISED) and sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        # It may have ended while this process imported what it needs.
        if _orphaned():
            os.kill(os.getpid(), signal.SIGTERM)


def _orphaned() -> bool:
    """Return whether the process that supervises this one has ended."""
    supervisor = os.environ.get(SUPERVISED)
    return bool(supervisor) and os.getppid() != int(supervisor or 0)


def _settle() -> None:
    """Take what is there to stay out of garbage collection: a full one halts a node for 50 ms."""
    gc.collect()
    gc.freeze()


def run_node(factory: Callable[[], ManagedNode[Any]]) -> int:
    """Spin a node until a signal ends it; return the exit code.

    On SIGINT and SIGTERM the node comes to rest first, while it can still publish, and then the
    process ends. A parameter that is refused ends it with code 2 and one sentence on stderr.
    """
    end = threading.Event()
    node: ManagedNode[Any] | None = None

    def note(number: int, frame: FrameType | None) -> None:
        end.set()
        # Nothing moves yet: what it compiles or waits for is of no use.
        if _orphaned() and (node is None or not node.active):
            os._exit(0)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, note)
    end_with_supervisor()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    rclpy.init(args=sys.argv, signal_handler_options=rclpy.SignalHandlerOptions.NO)
    try:
        node = factory()
    except ParameterError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        rclpy.try_shutdown()
        return EXIT_REFUSED
    node.stop_requested = end.is_set
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        settled = False
        while rclpy.ok() and not end.is_set():
            executor.spin_once(timeout_sec=_SPIN_PERIOD)
            if node.active and not settled:
                _settle()
            settled = node.active
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.come_to_rest()
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    if os.environ.get(SUPERVISED) and end.is_set():
        # Everything is closed; taking the interpreter apart takes longer than all of that.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)
    return 0
