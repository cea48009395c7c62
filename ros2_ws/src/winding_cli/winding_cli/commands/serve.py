"""`winding serve`: take runs as goals from a cell controller."""

import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from correction_node.models.weights import SHIPPED
from winding_cli.cell.goals import GoalError, Goals
from winding_cli.terminal.output_path import check_output_folder
from winding_cli.terminal.record_options import Domain, Namespace
from winding_cli.terminal.refusal import refuse, refused
from winding_cli.terminal.ros_environment import check_namespace, joined, plain_node
from winding_core.parameters import ParameterError
from winding_core.run_spec import GOAL_OPTIONS, SECTION_OF, RunSpec

_LOOK = 1.5  # Discovery of a server that runs already [s]


def serve(
    *,
    output: Annotated[Path, typer.Option(help="Gets a folder for every goal.")] = Path("runs"),
    record: Annotated[
        bool, typer.Option("--record", help="Record every run into `bag` in its folder.")
    ] = False,
    namespace: Namespace = "winding",
    domain: Domain = None,
) -> None:
    """Serve run/send_goal, run/cancel_goal and run/get_result until Ctrl-C."""
    check_namespace(namespace)
    check_output_folder(output, "--output")
    with joined(domain) as place:
        from winding_cli.cell.goal_node import GoalServer, is_served
        from winding_ros.topics import RUN_SERVER
        from winding_supervisor.session.domain_lock import DomainError, server_lock

        command = [sys.executable, "-m", "winding_cli.cli", "run", "--namespace", namespace]
        goals = Goals(
            [*command, "--domain", str(place.domain)],
            output.absolute(),
            time.time_ns,
            record=record,
        )
        try:
            with (
                refused(DomainError),
                server_lock(place.domain, namespace),
                suppress(KeyboardInterrupt),
                plain_node(RUN_SERVER, namespace) as (node, executor),
            ):
                if is_served(node, _LOOK):
                    refuse(f"DDS domain {place.domain} has a server of goals in /{namespace}")
                GoalServer(node, goals, check_goal)
                print(f"waiting for goals on /{namespace}/run/send_goal; Ctrl-C ends", flush=True)
                while True:
                    # A signal is only seen between two waits.
                    executor.spin_once(timeout_sec=0.1)
        finally:
            goals.close()


def check_goal(wanted: Mapping[str, object]) -> None:
    """Refuse what no goal may ask for: files, code, what is the server's, and what no run takes.

    Args:
        wanted: Options of `winding run` by name, with underscores.

    Raises:
        GoalError: The first option that is refused, in one sentence.
    """
    for name, value in wanted.items():
        if value is None:
            raise GoalError(f"{name} has no value")
        if name in SECTION_OF and name not in (*GOAL_OPTIONS, "weights"):
            raise GoalError(f"a goal cannot set {name}: files, code and places are the server's")
    weights = wanted.get("weights", "rod")
    if weights not in SHIPPED:
        raise GoalError(
            f"weights must be one of {', '.join(SHIPPED)}, got {str(weights)[:80]!r}: "
            "a goal cannot name a folder"
        )
    try:
        RunSpec.from_goal({name: value for name, value in wanted.items() if name != "weights"})
    except ParameterError as error:
        raise GoalError(str(error)) from error
