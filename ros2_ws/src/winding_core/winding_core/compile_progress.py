"""Which kernels a process compiles, for whoever waits for it; nothing of the compiler's is here."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

COMPILING = "compiling"  # Key of the value of a node's status that holds how far its kernels are


@dataclass(frozen=True, kw_only=True)
class Compiling:
    """A kernel whose compilation begins."""

    kernel: str  # Its name
    number: int  # Its place among those that this process compiled, from 1
    count: int  # Kernels of this process without code on disk; it may need fewer

    @property
    def share(self) -> str:
        """How far the process is, such as `3 of 17`."""
        return f"{self.number} of {max(self.number, self.count)}"

    @property
    def sentence(self) -> str:
        """What a terminal and a log show."""
        return f"compiling {self.share} kernels (first start only): {self.kernel}"


@dataclass(kw_only=True)
class CompileProgress:
    """Counts kernels and reports those that are compiled; threads may compile at once."""

    missing: set[str] = field(default_factory=set)  # Kernels whose code is not on disk
    begun: dict[str, None] = field(default_factory=dict)  # Those that were compiled, in order
    _open: set[str] = field(default_factory=set)  # Those that are compiled now
    _tell: list[Callable[[Compiling | None], None]] = field(default_factory=list)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self, kernel: str) -> None:
        """Take note that a kernel is compiled from now on."""
        with self._lock:
            if kernel in self.begun:
                return
            self.begun[kernel] = None
            self._open.add(kernel)
            item = Compiling(kernel=kernel, number=len(self.begun), count=len(self.missing))
            listeners = tuple(self._tell)
        for tell in listeners:
            tell(item)

    def end(self, kernel: str) -> None:
        """Take note that a kernel is compiled."""
        with self._lock:
            if kernel not in self._open:
                return
            self._open.remove(kernel)
            listeners = () if self._open else tuple(self._tell)
        for tell in listeners:
            tell(None)

    @contextmanager
    def heard(self, tell: Callable[[Compiling | None], None]) -> Iterator[None]:
        """Report every kernel that this process compiles in the body, and None after the last."""
        self._tell.append(tell)
        try:
            yield
        finally:
            self._tell.remove(tell)


PROGRESS = CompileProgress()
