"""Serve the operator's page: python -m winding_dashboard --ros-args ..."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence

import rclpy
from nicegui import app, ui
from rclpy.context import Context
from rclpy.parameter import Parameter

from winding_core.parameters import ParameterError
from winding_dashboard.node import DashboardNode
from winding_dashboard.views.access import Gate
from winding_dashboard.views.page import PERIOD, Page
from winding_ros.process import EXIT_REFUSED, end_with_supervisor

_LIFECYCLE_PERIOD = 1.0
_RECONNECT = 15.0


def main(arguments: Sequence[str] | None = None, values: Mapping[str, object] | None = None) -> int:
    """Join the graph and serve the page until a signal; return the exit code.

    Args:
        arguments: ROS arguments; those of the process when not given.
        values: Parameters by name, over those of the arguments.
    """
    end_with_supervisor()
    context = Context()
    rclpy.init(
        args=sys.argv if arguments is None else list(arguments),
        context=context,
        # The web server ends on a signal, and the node after it.
        signal_handler_options=rclpy.SignalHandlerOptions.NO,
    )
    try:
        overrides = [Parameter(name, value=value) for name, value in (values or {}).items()]
        node = DashboardNode(context, parameter_overrides=overrides)
    except ParameterError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        rclpy.try_shutdown(context=context)
        return EXIT_REFUSED
    node.start()
    try:
        serve(node)
    finally:
        node.close()
        rclpy.try_shutdown(context=context)
    return 0


def serve(node: DashboardNode) -> None:
    """Serve the page of a node; return when the web server has ended."""
    parameters = node.parameters

    async def ask_lifecycle() -> None:
        node.state.health.lifecycle = await node.service_client.lifecycle()

    def show() -> None:
        Page(node.state, node.service_client, time.monotonic)

    app.add_middleware(Gate, token=parameters.token, host=parameters.host)
    app.timer(PERIOD, lambda: node.topic_reader.look(time.monotonic()))
    app.timer(PERIOD, node.beat)
    app.timer(_LIFECYCLE_PERIOD, ask_lifecycle)
    print(f"operator's page: http://{parameters.host}:{parameters.port}", flush=True)
    ui.run(
        show,
        host=parameters.host,
        port=parameters.port,
        title="Cable winding",
        language="en-US",
        reload=False,
        show=False,
        show_welcome_message=False,
        binding_refresh_interval=None,
        # A browser on a busy machine may be late by seconds; a page that is reloaded is worse.
        reconnect_timeout=_RECONNECT,
        # Packing costs more time than it saves on loopback and on a local network.
        gzip_middleware_factory=None,
    )


if __name__ in {"__main__", "__mp_main__"}:
    sys.exit(main())
