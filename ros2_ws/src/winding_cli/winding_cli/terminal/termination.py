"""What SIGINT and SIGTERM do to a command, from its first import to its last line.

A command that has opened nothing ends at once, whatever it imports or computes. One that has
something to close does so within `interruptible`, one that writes a file within `uninterrupted`.
Whichever it is, one sentence reports it and the exit code is 130.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
_NUMBERS = (signal.SIGINT, signal.SIGTERM)
_SHOW_CURSOR = b"\r\x1b[K\x1b[?25h"

_Handler = Callable[[int, FrameType | None], object]


def watch_signals() -> None:
    """Let signals end this process at once from now on."""
    _install(lambda number, frame: end())


def ignore_signals() -> None:
    """Let signals do nothing from now on: the command is over."""
    _install(signal.SIG_IGN)


def end(sentence: str = "interrupted") -> NoReturn:
    """End this process with one sentence; nothing that is open is closed."""
    ignore_signals()
    # A handler may have come in the middle of a print.
    with suppress(OSError, RuntimeError, ValueError):
        sys.stdout.flush()
    with suppress(OSError):
        terminal = _SHOW_CURSOR if os.isatty(2) else b""
        os.write(2, terminal + f"winding: {sentence}\n".encode())
    os._exit(INTERRUPTED)


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt in the body at the first signal: it has something to close.

    A second signal kills the children of this process, so that closing waits for none of them; a
    third ends the process at once.
    """
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1
        if count == 1:
            raise KeyboardInterrupt
        if count > 2:
            end()
        import psutil  # type: ignore[import-untyped]

        for child in psutil.Process().children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                child.kill()

    before = _install(interrupt)
    try:
        yield
    except BaseException:
        if count:
            # Whatever a child's death made of it.
            raise KeyboardInterrupt from None
        raise
    finally:
        _restore(before)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Put signals off until the body is over: it writes a file."""
    caught: list[int] = []
    before = _install(lambda number, frame: caught.append(number))
    try:
        yield
    finally:
        _restore(before)
        if caught:
            signal.raise_signal(caught[0])


def _install(handler: _Handler | signal.Handlers) -> dict[int, object]:
    """Return the handlers before; a signal that the shell ignores stays ignored.

    Signals come to the main thread: another one is interrupted by none.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}
    before = {number: signal.getsignal(number) for number in _NUMBERS}
    for number, present in before.items():
        if present is not signal.SIG_IGN:
            signal.signal(number, handler)
    return before  # type: ignore[return-value]


def _restore(before: dict[int, object]) -> None:
    for number, handler in before.items():
        signal.signal(number, handler)  # type: ignore[arg-type]
