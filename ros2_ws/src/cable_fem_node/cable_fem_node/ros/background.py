"""A task beside the node's own thread, at a lower priority."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from cable_fem_node.winding.run_history import AbandonedError

Result = TypeVar("Result")

# A third of the share of a thread in real time, and not starved on a busy machine.
_NICENESS = 5


class BackgroundTask(Generic[Result]):
    """Runs a function in a thread of its own; the owner asks for the result when it likes.

    Args:
        work: Gets a function that says whether the result is still wanted, and raises
            AbandonedError once it is not.
    """

    def __init__(self, work: Callable[[Callable[[], bool]], Result]) -> None:
        self._unwanted = threading.Event()
        self._result: Result | None = None
        self._error: Exception | None = None
        self._thread = threading.Thread(
            target=self._run, args=(work,), name="identification", daemon=True
        )
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether there is a result, or an error."""
        return not self._thread.is_alive()

    def result(self) -> Result:
        """Return what the function returned; only when done.

        Raises:
            Exception: What the function raised.
        """
        self._thread.join()
        if self._error is not None:
            raise self._error
        assert self._result is not None
        return self._result

    def abandon(self) -> None:
        """Ask the function to end, and wait until it has: at most one step of the rod."""
        self._unwanted.set()
        self._thread.join()

    def _run(self, work: Callable[[Callable[[], bool]], Result]) -> None:
        if sys.platform == "linux":
            # Linux keeps a niceness per thread.
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        try:
            self._result = work(lambda: not self._unwanted.is_set())
        except AbandonedError as error:
            self._error = error
        except Exception as error:  # noqa: BLE001 - handed to the owner's thread
            self._error = error
