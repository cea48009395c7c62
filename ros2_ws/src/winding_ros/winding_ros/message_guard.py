"""What a node lets in on one topic: time runs forward, one publisher speaks, refusals count."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from winding_ros.cadence import Cadence

# A stamp further ahead of the last one than this has to agree with the node's clock [s].
MAX_JUMP = 10.0
# Refusals that go on for longer are an error [s].
PATIENCE = 0.05
# A killed process lingers in the graph for its lease; its successor has the same name [s].
GHOST_PATIENCE = 10.0
UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"

Endpoint = tuple[str, str]


class StampError(ValueError):
    """A message's time cannot be."""


class MessageGuard:
    """Accepts and refuses the messages of one topic.

    Attributes:
        topic: Its name.
        accepted: Messages let in since the node was configured.
        refused: Messages kept out.
        reason: Why the last one was kept out.
        contested: Who else publishes; everything is kept out while this says something.
        queue: Most messages that were found waiting at once since `told`.
        cadence: Of a topic that has a fixed rate, since the run began; None for others.
    """

    def __init__(self, topic: str, *, steady: bool = False) -> None:
        """Let everything in that is in order.

        Args:
            topic: Its name.
            steady: Whether it has a fixed rate, whatever that is.
        """
        self.topic = topic
        self.cadence = Cadence(topic) if steady else None
        self.accepted = 0
        self.refused = 0
        self.reason = ""
        self.contested = ""
        self.queue = 0
        self._last: float | None = None
        self._refusing_since: float | None = None
        self._last_refusal = 0.0

    def restart(self) -> None:
        """Take the next stamp as it comes: a new run begins."""
        self._last = None
        self._refusing_since = None
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
        self._refusing_since = None

    def refuse(self, reason: str, now: float) -> None:
        """Count a message that was kept out at wall time `now` [s]."""
        self.refused += 1
        self.reason = reason
        self._last_refusal = now
        if self._refusing_since is None:
            self._refusing_since = now

    def found(self, count: int) -> None:
        """Note that so many messages waited when the node came to look."""
        self.queue = max(self.queue, count)

    def told(self) -> None:
        """Begin to look for the longest queue anew."""
        self.queue = 0

    @property
    def persistent(self) -> bool:
        """Whether nothing but refusals has come for longer than PATIENCE."""
        since = self._refusing_since
        return since is not None and self._last_refusal - since > PATIENCE


@dataclass(frozen=True, kw_only=True)
class Rivals:
    """Publishers of one topic, looked at again and again.

    Attributes:
        since: When one name was first seen twice, or None [s].
        sentence: Who contests the topic; empty when nobody does.
    """

    since: float | None = None
    sentence: str = ""

    def look(self, topic: str, publishers: Iterable[Endpoint], now: float) -> Rivals:
        """Return the judgement of the publishers (namespace, node) at wall time `now` [s]."""
        known = [endpoint for endpoint in publishers if endpoint[1] != UNKNOWN_NODE]
        if len(known) < 2:
            return Rivals()
        names = sorted({f"{namespace.rstrip('/')}/{node}" for namespace, node in known})
        since = now if self.since is None else self.since
        if len(names) == 1 and now - since <= GHOST_PATIENCE:
            return Rivals(since=since)
        return Rivals(
            since=since, sentence=f"{topic} has {len(known)} publishers: {', '.join(names)}"
        )
