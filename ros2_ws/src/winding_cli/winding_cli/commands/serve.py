"""`winding serve`: take runs as goals from a cell controller."""

from __future__ import annotations

import inspect
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from winding_cli.cell.goals import GoalError, Goals
from winding_cli.commands.run import run
from winding_cli.terminal.output_path import check_output_folder
from winding_cli.terminal.record_options import Domain, Namespace
from winding_cli.terminal.ros_environment import check_namespace, joined, plain_node
from winding_core.cable.condition import Condition
from winding_core.parameters import ParameterError, options, refuse_unknown

# Every goal gets them from the server.
_OWN = ("output", "namespace", "domain", "dashboard", "dashboard_port")


def serve(
    *,
    output: Annotated[Path, typer.Option(help="Gets a folder for every goal.")] = Path("runs"),
    namespace: Namespace = "winding",
    domain: Domain = None,
) -> None:
    """Serve run/send_goal, run/cancel_goal and run/get_result until Ctrl-C."""
    check_namespace(namespace)
    check_output_folder(output, "--output")
    with joined(domain) as place:
        from winding_cli.cell.goal_node import GoalServer
        from winding_ros.topics import RUN_SERVER

        command = [sys.executable, "-m", "winding_cli.cli", "run", "--namespace", namespace]
        goals = Goals([*command, "--domain", str(place.domain)], output, time.time_ns)
        print(f"waiting for goals on /{namespace}/run/send_goal; Ctrl-C ends", flush=True)
        try:
            with suppress(KeyboardInterrupt), plain_node(RUN_SERVER, namespace) as (node, executor):
                GoalServer(node, goals, check_goal)
                while True:
                    # A signal is only seen between two waits.
                    executor.spin_once(timeout_sec=0.1)
        finally:
            goals.close()


def check_goal(wanted: Mapping[str, object]) -> None:
    """Refuse what no run takes.

    Args:
        wanted: Options of `winding run` by name, with underscores.

    Raises:
        GoalError: An unknown option or a value that cannot be.
    """
    known = [name for name in inspect.signature(run).parameters if name not in _OWN]
    typed = {name: value for name, value in wanted.items() if name in options(Condition)}
    try:
        refuse_unknown(wanted, known, owner="a goal")
        Condition.from_typed(typed)
    except ParameterError as error:
        raise GoalError(str(error)) from error
