"""A task beside the node's own thread, at a lower priority."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

Result = TypeVar("Result")

# A third of the share of the process's other threads, and not starved on a busy machine.
_NICER, _NICEST = 5, 19


class BackgroundTask(Generic[Result]):
    """Runs a function in a thread of its own; the owner asks for the result when it likes.

    Args:
        work: Gets a function that says whether the result is still wanted, and raises once it
            is not.
    """

    def __init__(self, work: Callable[[Callable[[], bool]], Result]) -> None:
        self._unwanted = threading.Event()
        self._pool = ThreadPoolExecutor(1, "identification", _lower_priority)
        self._future = self._pool.submit(work, lambda: not self._unwanted.is_set())

    @property
    def done(self) -> bool:
        """Whether there is a result, or an error."""
        return self._future.done()

    def result(self) -> Result:
        """Return what the function returned, or raise what it raised."""
        self._pool.shutdown()
        return self._future.result()

    def abandon(self) -> None:
        """Ask the function to end, and wait until it has: at most one step of the rod."""
        self._unwanted.set()
        self._pool.shutdown()


def _lower_priority() -> None:
    if sys.platform == "linux":
        # Linux keeps a niceness per thread; a process that is nice itself may not become less so.
        thread = threading.get_native_id()
        present = os.getpriority(os.PRIO_PROCESS, thread)
        os.setpriority(os.PRIO_PROCESS, thread, min(present + _NICER, _NICEST))
