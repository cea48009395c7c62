"""One graph, and one server of goals, per DDS domain and namespace: a second one is refused."""

import fcntl
import getpass
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

MAX_DOMAIN = 232
# Neither folder nor file may be a link: whoever plants one would choose what is opened.
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_FILE = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC


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
        DomainError: Another graph on this machine holds it, or the lock may be another user's.
    """
    taken = f"DDS domain {domain} already runs a graph in namespace /{namespace}"
    with _held(f"domain-{domain}-{namespace.replace('/', '-')}.lock", taken):
        yield


@contextmanager
def server_lock(domain: int, namespace: str) -> Iterator[None]:
    """Hold the place of the server of goals of a (domain, namespace), beside the graph's own lock.

    Raises:
        DomainError: As in `domain_lock`.
    """
    taken = f"DDS domain {domain} already has a server of goals in namespace /{namespace}"
    with _held(f"server-{domain}-{namespace.replace('/', '-')}.lock", taken):
        yield


@contextmanager
def _held(name: str, taken: str) -> Iterator[None]:
    """Hold a lock file of this user's folder."""
    path = lock_folder() / name
    try:
        path.parent.mkdir(mode=0o700, exist_ok=True)
        folder = os.open(path.parent, _FOLDER)
        try:
            _check_own(path.parent, folder)
            lock = os.open(name, _FILE, 0o600, dir_fd=folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise DomainError(
            f"the lock {path} cannot be held: {error.strerror}; no link is followed"
        ) from error
    try:
        _check_own(path, lock)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DomainError(f"{taken}; choose another with --domain or --namespace") from None
        yield
    finally:
        os.close(lock)


def _check_own(path: Path, descriptor: int) -> None:
    """Refuse what another user owns or may write to.

    Raises:
        DomainError: It is so, or a file is none.
    """
    found = os.fstat(descriptor)
    if found.st_uid != os.geteuid():
        raise DomainError(f"the lock {path} belongs to user {found.st_uid}: remove it")
    if found.st_mode & 0o022:
        raise DomainError(
            f"the lock {path} has mode {stat.S_IMODE(found.st_mode):04o}: others may write to it"
        )
    if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
        raise DomainError(f"the lock {path} is no file")
