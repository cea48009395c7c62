"""What supervision saw and did, one line of JSON each."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

# A run that fails and resumes without end may not fill disk or memory: two files of this size
# [bytes], and so many events.
FILE_LIMIT = 1_000_000
_EVENT_LIMIT = 10_000


@dataclass(frozen=True, kw_only=True)
class Event:
    """One thing that supervision saw or did."""

    wall: float  # Monotonic wall time [s]
    t: float  # Simulated time [s]
    what: str  # detected, stopped, standing, restarting, restarted, resumed or ended
    node: str  # Node or signal that it is about
    text: str  # What happened


@dataclass(kw_only=True)
class EventLog:
    """Events of one run, in memory and in a file of the run's folder."""

    file: Path | None  # Where they are appended, or None; a full one is kept once, as `NAME.1`
    clock: Callable[[], float] = time.monotonic  # Wall time, monotonic [s]
    events: list[Event] = field(default_factory=list)  # All of them, or the latest few thousand

    def note(
        self, what: str, node: str, text: str, *, t: float, wall: float | None = None
    ) -> Event:
        """Add an event of simulated time t [s]; its wall time [s] is now unless it is given."""
        event = Event(
            wall=self.clock() if wall is None else wall, t=t, what=what, node=node, text=text
        )
        self.events.append(event)
        if len(self.events) > _EVENT_LIMIT:
            del self.events[: _EVENT_LIMIT // 2]
        if self.file is not None:
            if self.file.exists() and self.file.stat().st_size > FILE_LIMIT:
                self.file.replace(self.file.with_name(f"{self.file.name}.1"))
            with self.file.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(event.__dict__) + "\n")
        return event

    def find(self, what: str, node: str | None = None, since: float = 0.0) -> Event | None:
        """Return the first event of a kind, of a node if one is named, after a wall time [s]."""
        for event in self.events:
            if event.what == what and event.wall >= since and node in (None, event.node):
                return event
        return None


def read_events(file: Path) -> list[Event]:
    """Return the events of a run's file; none when there was nothing to see."""
    if not file.exists():
        return []
    return [Event(**json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]
