"""Subscription validation: forward time, one publisher, rate and losses; with its status."""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from winding_core.status import Level, Status

# The period is the median of so many steps and looked at again after so many messages.
STEPS = 64
LOOKED_AT_EVERY = 32
LEAST_STEPS = 8
# A gap longer than so many periods lost messages; one longer than this is an interruption [s].
LOST = 1.5
INTERRUPTION = 1.0
LATE = 0.05  # A message that follows its predecessor so much later than by their stamps is late [s]
# Share of lost messages that raises a warning, once so many have come.
WARNING_SHARE = 0.01
WARNING_AFTER = 200


class Cadence:
    """Counts what is lost, doubled, reordered and late, against the median period."""

    def __init__(self, topic: str) -> None:
        self.topic = topic  # Its name
        self.period = 0.0  # Median step between stamps [s]; 0 before there are enough
        # Messages by what is wrong with them; an interruption counts once.
        self.counts = dict.fromkeys(("lost", "doubled", "reordered", "late", "interrupted"), 0)
        self._came = 0
        self._steps: deque[float] = deque(maxlen=STEPS)
        self._stamp: float | None = None
        self._arrival = 0.0

    def take(self, stamp: float, arrival: float) -> None:
        """Count a message of a stamp [s] that arrived at a wall time [s]."""
        before, came = self._stamp, self._arrival
        if before is not None and stamp < before:
            self.counts["reordered"] += 1
            return
        self._stamp, self._arrival = stamp, arrival
        self._came += 1
        if before is None:
            return
        step = stamp - before
        if step == 0.0:
            self.counts["doubled"] += 1
            return
        if arrival - came > step + LATE:
            self.counts["late"] += 1
        if step > INTERRUPTION and step > LOST * self.period > 0.0:
            self.counts["interrupted"] += 1
            return
        if self.period and step > LOST * self.period:
            self.counts["lost"] += round(step / self.period) - 1
        self._steps.append(step)
        if self._came % LOOKED_AT_EVERY == 0 or len(self._steps) == LEAST_STEPS:
            self.period = statistics.median(self._steps)

    def values(self) -> dict[str, str]:
        """Return rate [Hz] and counts as values of a status; nothing before they are known."""
        if not self.period:
            return {}
        counts = {
            f"{what} {self.topic}": str(count) for what, count in self.counts.items() if count
        }
        return {f"rate {self.topic}": f"{1.0 / self.period:.1f}", **counts}

    @property
    def warning(self) -> str:
        """One sentence if many messages are lost; otherwise empty."""
        lost = self.counts["lost"]
        share = lost / (lost + self._came) if self._came >= WARNING_AFTER else 0.0
        if share < WARNING_SHARE:
            return ""
        return f"{self.topic} has lost {share:.0%} of its messages at {1.0 / self.period:.0f} Hz"


# A stamp further ahead of the last one than this has to agree with the node's clock [s].
MAX_JUMP = 10.0
# Refusals that go on for longer, by the stamps of what is refused, are an error [s].
PATIENCE = 0.05
# A killed process lingers in the graph for its lease; its successor has the same name [s].
GHOST_PATIENCE = 10.0
UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"

Endpoint = tuple[str, str]


class StampError(ValueError):
    """A message's time cannot be."""


class MessageGuard:
    """Accepts and refuses the messages of one topic."""

    def __init__(self, topic: str, *, steady: bool = False) -> None:
        """Let everything in that is in order.

        Args:
            topic: Its name.
            steady: Whether it has a fixed rate, whatever that is.
        """
        self.topic = topic  # Its name
        # Of a topic that has a fixed rate, since the run began; None for others.
        self.cadence = Cadence(topic) if steady else None
        self.accepted = 0  # Messages let in since the run began
        self.refused = 0  # Messages kept out
        self.reason = ""  # Why the last one was kept out
        # Why messages were kept out for longer than PATIENCE; latched until `restart`.
        self.alarm = ""
        self.contested = ""  # Who else publishes; everything is refused while this is not empty
        self.queue = 0  # Most messages that were found waiting at once since `restart_queue`
        self._last: float | None = None
        # Since when nothing but refusals has come: a stamp, if it is usable, and an arrival [s].
        self._refusing: tuple[float | None, float] | None = None
        self._in_a_row = 0

    def restart(self) -> None:
        """Take the next stamp as it comes, and release the alarm: a new run begins."""
        self._last = None
        self._refusing = None
        self.alarm = ""
        self.accepted = self.refused = 0
        if self.cadence is not None:
            self.cadence = Cadence(self.topic)

    def check(self, stamp: float, clock: Callable[[], float], arrival: float = 0.0) -> None:
        """Refuse a stamp [s] that runs backwards, or far ahead of the node's own clock [s].

        Args:
            stamp: [s]
            clock: Gives the time of the node [s].
            arrival: Wall time [s].

        Raises:
            StampError: The message has to be kept out.
        """
        if self.contested:
            raise StampError(self.contested)
        last = self._last
        if last is not None and stamp > last + MAX_JUMP and stamp > clock() + MAX_JUMP:
            raise StampError(f"time jumped from {last:.3f} to {stamp:.3f} s")
        if self.cadence is not None:
            self.cadence.take(stamp, arrival)
        if last is not None and stamp < last:
            raise StampError(f"time went back from {last:.3f} to {stamp:.3f} s")
        self._last = stamp

    def accept(self) -> None:
        """Count a message that was let in."""
        self.accepted += 1
        self._refusing = None

    def refuse(self, reason: str, stamp: float | None, arrival: float) -> None:
        """Count a message that was kept out, and latch the alarm when this goes on.

        How long it goes on is a matter of stamps: a reader that was held looks at a second of
        messages within a millisecond.

        Args:
            reason: Why.
            stamp: [s]; None for one that is itself the reason.
            arrival: Wall time [s].
        """
        self.refused += 1
        self.reason = reason
        if self._refusing is None:
            self._refusing, self._in_a_row = (stamp, arrival), 0
        self._in_a_row += 1
        first_stamp, first_arrival = self._refusing
        period = 0.0 if self.cadence is None else self.cadence.period
        if stamp is not None and first_stamp is not None:
            lasted = stamp - first_stamp
        elif period:
            lasted = (self._in_a_row - 1) * period
        else:
            lasted = arrival - first_arrival
        if lasted > PATIENCE and not self.alarm:
            self.alarm = f"refused a message on {self.topic}: {reason}"

    def found(self, count: int) -> None:
        """Note that so many messages waited when the node came to look."""
        self.queue = max(self.queue, count)

    def restart_queue(self) -> None:
        """Begin to look for the longest queue anew."""
        self.queue = 0


@dataclass(frozen=True, kw_only=True)
class Rivals:
    """Publishers of one topic, looked at again and again."""

    since: float | None = None  # When one name was first seen twice, or None [s].
    topic: str = ""  # That is contested; empty when it is not.
    text: str = ""  # By whom, to follow its name.

    @property
    def sentence(self) -> str:
        """Who contests the topic; empty when none does."""
        return f"{self.topic} {self.text}" if self.text else ""

    def look(self, topic: str, publishers: Iterable[Endpoint], now: float) -> Rivals:
        """Return the judgement of the publishers (namespace, node) at wall time `now` [s]."""
        known = [endpoint for endpoint in publishers if endpoint[1] != UNKNOWN_NODE]
        if len(known) < 2:
            return Rivals()
        names = sorted({f"{namespace.rstrip('/')}/{node}" for namespace, node in known})
        since = now if self.since is None else self.since
        if len(names) == 1 and now - since <= GHOST_PATIENCE:
            return Rivals(since=since)
        text = f"has {len(known)} publishers: {', '.join(names)}"
        return Rivals(since=since, topic=topic, text=text)


_MATCHED = "matched "


def topic_status(
    node: str,
    subscribers: Mapping[str, int],
    guards: Mapping[str, MessageGuard],
    contested: Sequence[str],
) -> Status:
    """Return the status of a node's topics.

    Args:
        node: Its name.
        subscribers: How many subscriptions each of its publishers has, by topic.
        guards: What it made of the messages of each topic that it hears.
        contested: One sentence for each topic that others publish too.
    """
    values = {f"{_MATCHED}{name}": str(count) for name, count in subscribers.items()}
    refusing = [guard for guard in guards.values() if guard.refused]
    values |= {f"heard {name}": str(item.accepted) for name, item in guards.items()}
    values |= {f"queue {name}": str(item.queue) for name, item in guards.items()}
    values |= {f"refused {item.topic}": str(item.refused) for item in refusing}
    cadences = [guard.cadence for guard in guards.values() if guard.cadence is not None]
    for cadence in cadences:
        values |= cadence.values()
    errors = [*contested, *(guard.alarm for guard in refusing if guard.alarm)]
    warnings = [
        f"refused a message on {guard.topic}: {guard.reason}"
        for guard in refusing
        if not guard.alarm
    ]
    warnings += [cadence.warning for cadence in cadences if cadence.warning]
    return Status(
        name=f"{node}: topics",
        level=Level.ERROR if errors else Level.WARN if warnings else Level.OK,
        message="; ".join([*errors, *warnings]),
        values=values,
    )


def subscribers_of(values: Mapping[str, str]) -> dict[str, int]:
    """Return how many subscriptions each publisher has, by topic, from the values of a status."""
    return {
        key.removeprefix(_MATCHED): int(value)
        for key, value in values.items()
        if key.startswith(_MATCHED) and value.isdigit()
    }


def news(statuses: Iterable[Status]) -> list[object]:
    """Return what of these statuses is published at once when it changes."""
    return [
        (status.name, status.level, status.message, subscribers_of(status.values))
        for status in statuses
    ]
