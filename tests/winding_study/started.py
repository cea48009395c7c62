"""Commands that run in processes of their own, and the wait for what they do."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable

PATIENCE = 120.0  # Ten times what a loaded machine needs for imports and a first case


def start(command: str, *arguments: object, **how: object) -> subprocess.Popen[str]:
    """Start a command of `winding`; `how` is for Popen."""
    return subprocess.Popen(
        [sys.executable, "-m", "winding_cli.cli", command, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **how,  # type: ignore[call-overload]
    )


def wait_for(true: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    """Wait on a predicate, and fail when the process ends before."""
    pause = threading.Event()
    until = time.monotonic() + PATIENCE
    while not true():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        pause.wait(0.02)
