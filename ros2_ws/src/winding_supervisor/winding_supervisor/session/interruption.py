"""SIGINT and SIGTERM while an event loop runs: what is open is closed, whatever comes when."""

import asyncio
import faulthandler
import signal
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import AsyncExitStack, ExitStack, contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import IO, Any, TypeVar

import psutil  # type: ignore[import-untyped]

Result = TypeVar("Result")

_NUMBERS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Counts the signals that end what a process does.

    The first cancels the work, which is then closed in order. The second kills the children of
    this process, so that closing waits for none of them. A third cancels once more, should the
    work have missed the first.
    """

    def __init__(self) -> None:
        self.hastened = asyncio.Event()  # Set by the second signal
        self.signal = ""  # Name of the first signal; empty before it
        self._count = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        self._cancel: Callable[[], object] | None = None
        self._instead: Callable[[], object] | None = None

    @property
    def happened(self) -> bool:
        """Whether a signal has come."""
        return self._count > 0

    def instead_of_sigint(self, act: Callable[[], object]) -> None:
        """Let the next SIGINT call `act` and count for nothing."""
        self._instead = act

    async def unless_hastened(self, close: Callable[[], Coroutine[Any, Any, object]]) -> None:
        """Await a closer, but not beyond the second signal."""
        closing = asyncio.create_task(close())
        hastened = asyncio.create_task(self.hastened.wait())
        await asyncio.wait({closing, hastened}, return_when=asyncio.FIRST_COMPLETED)
        hastened.cancel()
        if closing.done():
            closing.result()
        closing.cancel()

    def receive(self, number: int, frame: FrameType | None = None) -> None:
        """Take a signal, in a handler of the interpreter."""
        act: Callable[[], object] = self._act
        self.signal = self.signal or signal.Signals(number).name
        if number == signal.SIGINT and self._instead is not None:
            act, self._instead = self._instead, None
        else:
            self._count += 1
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(act)

    def begin(self, cancel: Callable[[], object]) -> None:
        """Act on signals from now on, in the event loop that runs; earlier ones count."""
        self._cancel, self._loop = cancel, asyncio.get_running_loop()
        if self._count:
            cancel()
            self._act()

    def _act(self) -> None:
        if self._cancel is not None and (self._count == 1 or self._count > 2):
            self._cancel()
        if self._count > 1:
            self.hastened.set()
            for child in psutil.Process().children(recursive=True):
                with suppress(psutil.NoSuchProcess):
                    child.kill()


@contextmanager
def ended_if_stuck(patience: float, file: Path) -> Iterator[None]:
    """End this process with code 1 if the body, which only closes, does not come to its end.

    The body may hang with the interpreter's lock held: no thread of Python would run any more.

    Args:
        patience: After so long [s].
        file: Gets what every thread was at; nothing is left of it where the body ends in time.
    """
    with ExitStack() as stack:
        try:
            tracebacks: IO[str] = stack.enter_context(file.open("w", encoding="utf-8"))
        except OSError:
            # The disk is full, or the run's folder is gone.
            tracebacks = sys.stderr
        faulthandler.dump_traceback_later(patience, exit=True, file=tracebacks)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
    file.unlink(missing_ok=True)


Work = Callable[[AsyncExitStack, Interruption], Coroutine[Any, Any, Result]]


def run_closing(work: Work[Result]) -> Result:
    """Run a coroutine in a new event loop and close in reverse what it has opened.

    A signal cancels the coroutine and never a closer.

    Args:
        work: Pushes a closer on the stack for everything that it opens. Closers that wait watch
            `Interruption.hastened`.

    Raises:
        KeyboardInterrupt: SIGINT or SIGTERM has come; everything is closed.
    """
    interruption = Interruption()
    before = {number: signal.getsignal(number) for number in _NUMBERS}
    try:
        for number, handler in before.items():
            if handler is not signal.SIG_IGN:
                signal.signal(number, interruption.receive)
        result = asyncio.run(_close_after(work, interruption))
    except BaseException:
        if interruption.happened:
            raise KeyboardInterrupt from None
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if interruption.happened:
        raise KeyboardInterrupt
    return result


async def _close_after(work: Work[Result], interruption: Interruption) -> Result:
    async with AsyncExitStack() as stack:
        task = asyncio.create_task(work(stack, interruption))
        interruption.begin(task.cancel)
        # It ends with the work and not with its error.
        await asyncio.wait({task})
    return task.result()
