"""The space key of a terminal, while a command is busy."""

from __future__ import annotations

import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_KEY_PERIOD = 0.1


@contextmanager
def space_key(toggle: Callable[[], bool], stopped: threading.Event) -> Iterator[None]:
    """Call `toggle` whenever the space key of the terminal is pressed."""
    if not sys.stdin.isatty():
        yield
        return
    import termios
    import tty

    def listen() -> None:
        while not stopped.is_set():
            ready, _, _ = select.select([sys.stdin], [], [], _KEY_PERIOD)
            if ready and sys.stdin.read(1) == " ":
                print("paused" if toggle() else "playing", file=sys.stderr, flush=True)

    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    thread = threading.Thread(target=listen, name="keys", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
