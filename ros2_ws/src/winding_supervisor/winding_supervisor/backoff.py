"""How often and how soon a node may be started again."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field


@dataclass(kw_only=True)
class Backoff:
    """Counts the restarts of one node.

    Attributes:
        limit: Restarts allowed within the window.
        window: Wall time over which they count [s].
        first: Wait before the second restart [s]; it doubles with each further one.
    """

    limit: int = 3
    window: float = 60.0
    first: float = 0.5
    _restarts: deque[float] = field(default_factory=deque)

    def next_wait(self, now: float) -> float | None:
        """Return how long to wait before a restart at `now` [s]; None when there were too many."""
        while self._restarts and now - self._restarts[0] > self.window:
            self._restarts.popleft()
        count = len(self._restarts)
        if count >= self.limit:
            return None
        self._restarts.append(now)
        return 0.0 if count == 0 else self.first * 2.0 ** (count - 1)
