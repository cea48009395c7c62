"""Sends commands on while the node is at other work, or waits for the machine's readings."""

import threading
from collections.abc import Callable, Iterable

from winding_ros.runtime.message_handler import Answer

_PERIOD = 0.02


class CommandCarrier:
    """A thread that asks again and again for what has to leave meanwhile.

    Args:
        carried: Returns the commands to send at a monotonic time [s].
        publish: Sends them, from any thread.
        clock: Monotonic time [s].
    """

    def __init__(
        self,
        carried: Callable[[float], Iterable[Answer]],
        publish: Callable[[Iterable[Answer]], None],
        clock: Callable[[], float],
    ) -> None:
        self._carried = carried
        self._publish = publish
        self._clock = clock
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Send nothing any more."""
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(_PERIOD):
            self._publish(self._carried(self._clock()))
