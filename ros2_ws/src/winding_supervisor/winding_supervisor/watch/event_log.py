"""What supervision saw and did, and why the run ended, one line of JSON for each event."""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from winding_core.run_outcome import Cause, Ending, Event, Motion, Stop

# A run that fails and resumes without end may not fill disk or memory: two files of this size
# [bytes], and so many events.
FILE_LIMIT = 1_000_000
_EVENT_LIMIT = 10_000


@dataclass(kw_only=True)
class EventLog:
    """Events of a session, in memory and in a file of its folder; how its present run ends.

    A disk that takes no more delays nothing and ends nothing: the events stay in memory.
    """

    file: Path | None  # Where they are appended, or None; a full one is kept once, as `NAME.1`
    clock: Callable[[], float] = time.monotonic  # Wall time, monotonic [s]
    events: list[Event] = field(default_factory=list)  # All of them, or the latest few thousand
    failure: str = ""  # Why the file misses events; empty where it does not
    cause: Cause | None = None  # Why the present run ends; the first is latched
    held: Cause | None = None  # Why its machine stands in mid-run; the first is latched
    stops: list[Stop] = field(default_factory=list)  # Of the present run
    _first: int = 0  # Of the present run's events

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
            self._first = max(0, self._first - _EVENT_LIMIT // 2)
        if self.file is not None:
            try:
                self._append(self.file, event)
            except OSError as error:
                self.failure = self.failure or f"{self.file.name} is incomplete: {error}"
        return event

    def hold(self, cause: Cause) -> None:
        """Note why the machine was stopped in mid-run, unless that is known already."""
        self.held = self.held or cause

    def resume(self) -> None:
        """Note that the machine winds on."""
        self.held = None

    def release(self, cause: Cause) -> None:
        """Note that what held the machine is dealt with, if it is this cause that holds it."""
        if self.held is cause:
            self.held = None

    def end(self, cause: Cause) -> Cause:
        """Note why the run ends; return the first cause, such as what stopped its machine."""
        self.cause = self.cause or self.held or cause
        return self.cause

    def stop(self, t: float, asked_by: str, failure: str) -> None:
        """Note a stop that the machine was asked for, and how that failed, if it did."""
        self.stops.append(Stop(t=t, asked_by=asked_by, failure=failure))

    def ending(self, machine: Motion) -> Ending:
        """Return how the present run has ended."""
        return Ending(
            cause=self.cause,
            machine=machine,
            stops=tuple(self.stops),
            events=tuple(self.events[self._first :]),
        )

    def begin_run(self) -> None:
        """Forget how the run before ended."""
        self.cause = self.held = None
        self.stops = []
        self._first = len(self.events)

    def _append(self, file: Path, event: Event) -> None:
        if file.exists() and file.stat().st_size > FILE_LIMIT:
            file.replace(file.with_name(f"{file.name}.1"))
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(event.__dict__) + "\n")


def read_events(file: Path) -> list[Event]:
    """Return the events of a run's file; none when there was nothing to see."""
    if not file.exists():
        return []
    return [Event(**json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]
