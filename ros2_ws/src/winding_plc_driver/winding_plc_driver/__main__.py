"""Drive a PLC-run machine: python -m winding_plc_driver --mapping machine.yaml --ros-args ..."""

import argparse
import asyncio
import contextlib
import logging
import os
import signal
import sys
import time
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from winding_plc_driver.driver import Driver
from winding_plc_driver.machine.mapping import (
    MachineMapping,
    MappingError,
    read_mapping,
    read_password,
)
from winding_plc_driver.node import QUANTITIES, PlcDriverNode
from winding_plc_driver.opcua.request import RefusedError
from winding_plc_driver.opcua.session import Session
from winding_ros.runtime.process import EXIT_REFUSED


def main() -> int:
    """Drive until a signal; return the exit code."""
    parser = argparse.ArgumentParser(prog="winding_plc_driver", description=__doc__)
    parser.add_argument("--mapping", type=Path, required=True, help="YAML file, see docs/opc-ua.md")
    mapping_file = parser.parse_args(remove_ros_args(sys.argv)[1:]).mapping
    # What the library logs as tracebacks, the driver reports in /diagnostics.
    logging.getLogger("asyncua").setLevel(logging.CRITICAL + 1)
    try:
        mapping = read_mapping(mapping_file, QUANTITIES)
        password = read_password(mapping.server, os.environ)
        with contextlib.ExitStack() as after:
            asyncio.run(_drive(mapping, password, after))
    except (MappingError, RefusedError) as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return EXIT_REFUSED
    return 0


async def _drive(mapping: MachineMapping, password: str, after: contextlib.ExitStack) -> None:
    """Drive until SIGINT or SIGTERM; what ROS needs is left on a stack.

    Raises:
        RefusedError: The PLC refuses user, certificate or mapping at once.
    """
    loop, task = asyncio.get_running_loop(), asyncio.current_task()
    assert task is not None
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, task.cancel)
    driver = Driver(mapping, Session(mapping, password), time.monotonic, time.time)
    with contextlib.suppress(asyncio.CancelledError):
        await driver.contact()
        context = Context()
        rclpy.init(args=sys.argv, context=context, signal_handler_options=SignalHandlerOptions.NO)
        after.callback(rclpy.try_shutdown, context=context)
        node = PlcDriverNode(
            context, driver.command, loop, mapping.server.endpoint, mapping.measured
        )
        after.callback(node.close)
        await driver.run(node)


if __name__ == "__main__":
    sys.exit(main())
