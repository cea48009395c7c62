"""How a run came out: what was asked and done, who ended it and why, what was lost and judged."""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from winding_core.error_verdict import ErrorVerdict
from winding_core.lay.errors import LayVerdict
from winding_core.units import json_values


class EndedBy(StrEnum):
    """Who or what ended a run."""

    COMPLETED = "completed"  # It came to the end that was asked for
    OPERATOR = "operator"
    SUPERVISION = "supervision"
    MACHINE = "machine"  # It stopped by itself, refused, or fell silent
    LIMIT = "limit"
    SIGNAL = "signal"
    FAULT = "fault"  # A process of the graph or of the session failed
    UNKNOWN = "unknown"  # A recording ends before its run


_PHRASES = {
    EndedBy.OPERATOR: "ended by the operator",
    EndedBy.SUPERVISION: "ended by supervision",
    EndedBy.MACHINE: "ended by the machine",
    EndedBy.LIMIT: "ended at a limit",
    EndedBy.SIGNAL: "ended by a signal",
    EndedBy.FAULT: "ended by a fault",
    EndedBy.UNKNOWN: "ends early",
}
# Endings that were not asked for.
_FAILURES = (EndedBy.SUPERVISION, EndedBy.MACHINE, EndedBy.LIMIT, EndedBy.FAULT)


class Motion(StrEnum):
    """What is known of the machine when its run is over."""

    STANDING = "standing"
    TURNING = "turning"
    UNKNOWN = "unknown"
    DRIVEN = "left to its driver"  # Which began by itself and ends by itself


_SAFE = (Motion.STANDING, Motion.DRIVEN)


class Verdict(StrEnum):
    """A run in a word or two."""

    GOOD = "good"
    NOT_GOOD = "not good"
    NOT_JUDGED = "not judged"
    INCOMPLETE = "incomplete"
    FAILED = "failed"

    @property
    def style(self) -> str:
        """How it is coloured: kept, broken or open."""
        return {Verdict.GOOD: "kept", Verdict.NOT_GOOD: "broken", Verdict.FAILED: "broken"}.get(
            self, "open"
        )


@dataclass(frozen=True, kw_only=True)
class Event:
    """One thing that supervision saw or did."""

    wall: float  # Monotonic wall time [s]
    t: float  # Time of the machine's newest sample [s]
    what: str  # detected, stopped, not stopped, standing, restarting, restarted, resumed or ended
    node: str  # Node or signal that it is about
    text: str  # What happened

    @property
    def sentence(self) -> str:
        """The event in words."""
        return f"{self.t:.3f} s: {self.what} {self.node}: {self.text}"


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A stop that the machine was asked for."""

    t: float  # Time of the machine's newest sample [s]
    asked_by: str  # supervision or session
    failure: str = ""  # Why it was not delivered; empty for one that was


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Why a run ended, or why its machine was stopped."""

    by: EndedBy  # Who or what ended it
    source: str  # Node, signal or service that it is about
    text: str  # One sentence
    t: float | None = None  # Time of the run [s]


@dataclass(frozen=True, kw_only=True)
class Ending:
    """How a run ended; without a cause it came to its end."""

    cause: Cause | None = None  # The first
    machine: Motion = Motion.STANDING  # What is known of it now
    stops: tuple[Stop, ...] = ()  # Each, in order
    events: tuple[Event, ...] = ()  # What supervision saw and did, in order

    @property
    def by(self) -> EndedBy:
        """Who or what ended it."""
        return EndedBy.COMPLETED if self.cause is None else self.cause.by

    @property
    def text(self) -> str:
        """The first cause; empty for a run that came to its end."""
        return "" if self.cause is None else self.cause.text

    @property
    def danger(self) -> str:
        """Why the machine may still move; empty for one that was seen standing."""
        failures = [stop.failure for stop in self.stops if stop.failure]
        if self.machine in _SAFE:
            return ""
        seen = "still turns" if self.machine is Motion.TURNING else "was not seen standing"
        return f"THE MACHINE {seen}" + (f": {failures[-1]}" if failures else "")


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How far a run goes; None for what is not known or was not asked for."""

    turns: float | None = None  # Of the cylinder
    time: float | None = None  # [s]
    length: float | None = None  # Of wound cable [m]
    markers: int | None = None  # That lie on the cylinder

    def as_json(self) -> dict[str, float | int | None]:
        """Return JSON values in SI units."""
        return json_values(self, "turns", "time_s", "length_m", "markers")


@dataclass(frozen=True, kw_only=True)
class RunOutcome:
    """How a run came out. Every output prints this record."""

    asked: Extent  # How far it was to go
    done: Extent  # How far it went
    ending: Ending  # How it ended
    losses: tuple[str, ...] = ()  # What was lost or refused, a sentence each
    lengths: ErrorVerdict | None = None  # Of the corrected lengths
    lay: LayVerdict | None = None  # Of a lay that the controller drove

    @property
    def complete(self) -> bool:
        """Whether the run came to its end and its machine stands."""
        return self.ending.by is EndedBy.COMPLETED and self.ending.machine in _SAFE

    @property
    def failed(self) -> bool:
        """Whether it ended as was not asked for, or its machine may still move."""
        return self.ending.by in _FAILURES or self.ending.machine not in _SAFE

    @property
    def verdict(self) -> Verdict:
        """The run in a word or two; good is only what is whole and keeps every limit."""
        if self.failed:
            return Verdict.FAILED
        if not self.complete:
            return Verdict.INCOMPLETE
        # The published or measured lengths are no measure of where a driven lay should lie.
        judged = [self.lengths.good if self.lengths is not None else None]
        if self.lay is not None:
            judged.append(self.lay.kept)
        if False in judged:
            return Verdict.NOT_GOOD
        return Verdict.NOT_JUDGED if None in judged else Verdict.GOOD

    @property
    def headline(self) -> str:
        """Who ended the run, how far it came, and why, in one sentence."""
        progress = ", ".join(self._progress()) or "nothing was wound"
        if self.ending.by is EndedBy.COMPLETED:
            return f"completed: {progress}"
        text = f": {self.ending.text}" if self.ending.text else ""
        return f"{_PHRASES[self.ending.by]} after {progress}{text}"

    @property
    def sentences(self) -> tuple[str, ...]:
        """The outcome in words, the gravest first."""
        judged = [] if self.lengths is None else [self.lengths.sentence]
        if self.lengths is not None and self.complete:
            judged.append(self.lengths.held_out_sentence)
        if self.lay is not None:
            judged.append(f"lay: {self.lay.sentence}")
        return tuple(filter(None, (self.ending.danger, self.headline, *self.losses, *judged)))

    def as_json(self) -> dict[str, Any]:
        """Return the outcome as JSON values; null where nothing is known."""
        cause = self.ending.cause
        return {
            "verdict": self.verdict.value,
            "complete": self.complete,
            "ended_by": self.ending.by.value,
            "cause": None if cause is None else json_values(cause, "source", "text", "t_s"),
            "machine": self.ending.machine.value,
            "asked": self.asked.as_json(),
            "done": self.done.as_json(),
            "sentences": list(self.sentences),
            "stops": [asdict(stop) for stop in self.ending.stops],
            "events": [
                json_values(item, "t_s", "what", "node", "text") for item in self.ending.events
            ],
            "losses": list(self.losses),
        }

    def _progress(self) -> Iterator[str]:
        for done, asked, form, unit in (
            (self.done.turns, self.asked.turns, ".2f", "turns"),
            (self.done.time, self.asked.time, ".2f", "s"),
            (self.done.markers, self.asked.markers, "d", "markers"),
        ):
            if done is None or not math.isfinite(done):
                continue
            of = "" if asked is None else f" of {asked:{form}}"
            yield f"{done:{form}}{of} {unit}"
