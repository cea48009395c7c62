"""How a command joins a graph: domain, namespace, policies, a node of its own."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.terminal.refusal import refuse, refused
from winding_cli.terminal.termination import interruptible

if TYPE_CHECKING:
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

_NAMESPACE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*")


@dataclass(frozen=True, kw_only=True)
class Joined:
    """Where a command stands."""

    domain: int  # DDS domain
    folder: Path  # Of the command alone; it is removed in the end


def check_namespace(namespace: str) -> None:
    """Refuse what is no namespace of a graph."""
    if not _NAMESPACE.fullmatch(namespace):
        refuse(f"namespace must be made of letters, digits, _ and /, got {namespace!r}")


@contextmanager
def joined(domain: int | None) -> Iterator[Joined]:
    """Set the process' environment before the first context reads it; signals interrupt the body.

    Args:
        domain: Of the command line, or None for the environment's.
    """
    from winding_ros.environment import set_process_environment
    from winding_supervisor.session.domain_lock import DomainError, chosen_domain

    with refused(DomainError):
        chosen = chosen_domain(domain)
    with interruptible(), tempfile.TemporaryDirectory(prefix="winding-") as folder:
        set_process_environment(chosen, Path(folder) / "log")
        yield Joined(domain=chosen, folder=Path(folder))


@contextmanager
def plain_node(name: str, namespace: str = "") -> Iterator[tuple[Node, SingleThreadedExecutor]]:
    """Yield a node in a context of its own, and the executor that it is added to."""
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    from winding_ros.environment import enclave_arguments, ros_arguments

    context = Context()
    words = [name, *enclave_arguments(namespace, name)]
    rclpy.init(args=words, context=context, signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node = Node(name, context=context, cli_args=ros_arguments(namespace))
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
