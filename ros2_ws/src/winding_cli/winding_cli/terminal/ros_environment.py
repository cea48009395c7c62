"""The DDS domain of a command that joins a graph, and a folder for what ROS writes meanwhile."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from winding_cli.terminal.refusal import refuse, refused
from winding_cli.terminal.termination import interruptible

_NAMESPACE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*")


@dataclass(frozen=True, kw_only=True)
class Joined:
    """Where a command stands.

    Attributes:
        domain: DDS domain.
        folder: Of the command alone; it is removed in the end.
    """

    domain: int
    folder: Path


def check_namespace(namespace: str) -> None:
    """Refuse what is no namespace of a graph."""
    if not _NAMESPACE.fullmatch(namespace):
        refuse(f"namespace must be made of letters, digits, _ and /, got {namespace!r}")


def refuse_open(namespace: str, *, dashboard: bool, lay_control: bool = False) -> None:
    """Refuse a graph whose nodes, and page where there is one, are not held to their policies."""
    from winding_ros.graph import GRAPH, PAGE, controlled
    from winding_ros.security import SecurityError, check_security

    with refused(SecurityError):
        graph = controlled() if lay_control else GRAPH
        check_security(namespace, graph=(*graph, PAGE) if dashboard else graph)


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
