"""Serve the operator's page: python -m winding_dashboard --ros-args ..."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from starlette.applications import Starlette

from winding_core.parameters import ParameterError
from winding_dashboard.drawings.arm_view import ArmView
from winding_dashboard.node import DashboardNode
from winding_dashboard.page.commands import CommandError
from winding_dashboard.page.recipes import Recipes
from winding_dashboard.page.run_list import RunList
from winding_dashboard.page.session import OperatorSession
from winding_dashboard.page.snapshot import Snapshots
from winding_dashboard.page.templates import Templates
from winding_dashboard.web.listening import listen
from winding_dashboard.web.server import application
from winding_ros.runtime.process import EXIT_REFUSED, end_with_supervisor

_LOOK, _LIFECYCLE = 0.1, 1.0


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
    folder = Path(parameters.runs) if parameters.runs else None
    session = OperatorSession(
        node.state,
        node.service_client,
        Recipes(folder and folder / "recipes"),
        lambda: node.limits,
        lambda: time.strftime("%H:%M:%S"),
        node.set_limits,
    )
    templates = Templates()
    snapshots = Snapshots(
        node.state,
        session,
        RunList(folder),
        templates.part,
        time.monotonic,
        secrets.token_hex(4),
        ArmView(parameters.machine_file),
    )

    async def look() -> None:
        node.topic_reader.look(time.monotonic())
        node.beat()

    async def ask() -> None:
        node.state_limits()
        node.look_for_player()
        node.state.health.lifecycle = await node.service_client.lifecycle()
        await session.learn_choice()
        with contextlib.suppress(CommandError):
            axes = await node.service_client.axes()
            if axes is not None:
                node.topic_reader.read_axes(axes)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        async with asyncio.TaskGroup() as tasks:
            loops = [
                tasks.create_task(_every(period, work))
                for period, work in ((_LOOK, look), (_LIFECYCLE, ask))
            ]
            yield
            for loop in loops:
                loop.cancel()

    print(f"operator's page: http://{parameters.host}:{parameters.port}", flush=True)
    app = application(
        snapshots, templates.page(), token=node.token, host=parameters.host, lifespan=lifespan
    )
    listen(app, parameters.host.strip("[]"), parameters.port)


async def _every(period: float, work: Callable[[], Awaitable[None]]) -> None:
    """Do something again and again, a period [s] from one beginning to the next at least."""
    loop = asyncio.get_running_loop()
    while True:
        begin = loop.time()
        await work()
        await asyncio.sleep(max(0.0, period - (loop.time() - begin)))


if __name__ == "__main__":
    sys.exit(main())
