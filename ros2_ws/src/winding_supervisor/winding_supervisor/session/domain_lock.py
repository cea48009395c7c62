"""One graph per DDS domain and namespace on a machine: a second one is refused."""

from __future__ import annotations

import fcntl
import getpass
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MAX_DOMAIN = 232


class DomainError(ValueError):
    """The wanted domain or namespace cannot be had."""


def chosen_domain(asked: int | None) -> int:
    """Return the DDS domain: what is asked for, else ROS_DOMAIN_ID, else 0.

    Raises:
        DomainError: Not a whole number of 0 to 232.
    """
    text = str(asked) if asked is not None else os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not text.isdecimal() or int(text) > MAX_DOMAIN:
        raise DomainError(f"the DDS domain must be a whole number of 0 to {MAX_DOMAIN}, got {text}")
    return int(text)


def lock_folder() -> Path:
    """Return the folder of this user's locks, one file for each domain and namespace."""
    return Path(tempfile.gettempdir()) / f"cable-winding-twin-{getpass.getuser()}"


@contextmanager
def domain_lock(domain: int, namespace: str) -> Iterator[None]:
    """Hold a (domain, namespace) for this process; the lock goes with the process, however it ends.

    Raises:
        DomainError: Another graph on this machine holds it.
    """
    folder = lock_folder()
    folder.mkdir(exist_ok=True)
    path = folder / f"domain-{domain}-{namespace.replace('/', '-')}.lock"
    with path.open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DomainError(
                f"DDS domain {domain} already runs a graph in namespace /{namespace}; choose "
                "another with --domain or --namespace"
            ) from None
        yield
