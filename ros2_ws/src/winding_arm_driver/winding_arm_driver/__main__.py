"""Follow a guide on a robot arm: python -m winding_arm_driver --mapping arm.yaml --ros-args ..."""

import argparse
import importlib
import signal
import sys
import threading
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from winding_core.arm.arm_file import MappingError, read_mapping
from winding_core.arm.opening import NOT_INSTALLED
from winding_ros.runtime.process import EXIT_REFUSED


def main() -> int:
    """Follow and lead the guide until a signal; return the exit code."""
    parser = argparse.ArgumentParser(prog="winding_arm_driver", description=__doc__)
    parser.add_argument("--mapping", type=Path, required=True, help="YAML file, see docs/arm.md")
    mapping_file = parser.parse_args(remove_ros_args(sys.argv)[1:]).mapping
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    try:
        mapping = read_mapping(mapping_file)
        node_module = importlib.import_module("winding_arm_driver.node")
    except MappingError as error:
        return _refused(str(error))
    except ImportError as error:
        if error.name != "pinocchio":
            raise
        return _refused(NOT_INSTALLED)
    context = Context()
    rclpy.init(args=sys.argv, context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = node_module.ArmDriverNode(mapping, context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)
        executor.shutdown()
        node.destroy_node()
    except ValueError as error:
        # Of mapping or arm: what the messages hold is refused one by one.
        return _refused(str(error))
    finally:
        rclpy.try_shutdown(context=context)
    return 0


def _refused(reason: str) -> int:
    print(f"error: {reason}", file=sys.stderr, flush=True)
    return EXIT_REFUSED


if __name__ == "__main__":
    sys.exit(main())
