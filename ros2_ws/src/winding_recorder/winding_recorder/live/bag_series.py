"""The bags of one recorder, one after the other; each is whole once it is closed."""

import errno
import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from winding_recorder.bags.description import (
    COMPLETE,
    LOST,
    REFUSED,
    YES,
    BagError,
    StoredMessage,
    jazzy_channel,
)
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.bags.writer import BagWriter
from winding_ros import topics
from winding_ros.topic import Taken, Topic

Answer = Callable[[bool, str], None]

_PUBLISHERS = 4  # A topic has one publisher; its predecessor and a few rivals are distinguished


class LossCount:
    """Follows the sequence numbers of a topic, which DDS counts from 1 for each publisher.

    A number belongs to the publisher whose last one is the nearest below it. One that is above none
    is a new publisher's; what it sent before is not known to be lost. What is lost after the last
    message that arrived cannot be seen.
    """

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self._last: list[int] = []  # Of the publishers that were heard most recently

    def take(self, sequence: int) -> None:
        """Count a message that arrived, and those that should have arrived before it."""
        self.received += 1
        nearest = max((last for last in self._last if last < sequence), default=None)
        if nearest is not None:
            self.lost += sequence - nearest - 1
            self._last.remove(nearest)
        self._last = [*self._last, sequence][-_PUBLISHERS:]


class Refusals:
    """What arrived on topics and could not be dealt with: how often, and why the first time."""

    def __init__(self) -> None:
        self._found: dict[str, tuple[int, str]] = {}

    def add(self, topic: str, reason: str) -> None:
        """Count one."""
        count, first = self._found.get(topic, (0, reason))
        self._found[topic] = (count + 1, first)

    def sentences(self, what: str) -> dict[str, str]:
        """Return a sentence for each topic.

        Args:
            what: Became of the messages, such as `could not be stored`.
        """
        return {
            topic: f"{count} messages {what}, the first because {reason}"
            for topic, (count, reason) in sorted(self._found.items())
        }


class RecorderError(BagError):
    """The recording cannot begin where it was asked to."""


def free_folder(first: Path) -> Path:
    """Return the first of `bag`, `bag-2`, `bag-3` and so on that does not exist."""
    candidate, count = first, 1
    while candidate.exists():
        count += 1
        candidate = first.with_name(f"{first.name}-{count}")
    return candidate


class BagSeries:
    """Writes into one bag at a time, from one thread.

    Args:
        recorded: Topics.
        full_names: Of each, by its name.
        config: How a bag is stored.
        notes: Texts about the run that a bag keeps, by name.
    """

    def __init__(
        self,
        recorded: Sequence[Topic],
        full_names: Mapping[str, str],
        config: BagConfig,
        notes: Mapping[str, str],
    ) -> None:
        self._notes: list[tuple[int, Mapping[str, str]]] = [(0, dict(notes))]
        self.folders: list[Path] = []  # Of all bags
        # What never arrived, of the topics that one node publishes, since a bag was begun.
        self.losses = {
            topic.name: LossCount()
            for topic in recorded
            if topic.publisher not in (topics.EVERY_NODE, topics.COMMANDER)
        }
        self.refused = Refusals()  # What arrived and could not be stored
        self.error: Exception | None = None  # What ended a bag before the run, if anything did
        self._recorded = tuple(recorded)
        self._full_names = full_names
        self._config = config
        self._index = {topic.name: k for k, topic in enumerate(recorded)}
        self._latched: dict[str, tuple[Topic, StoredMessage, int]] = {}
        self._arrived_ns = 0
        self._writer: BagWriter | None = None
        self._closings: list[threading.Thread] = []

    def note(self, notes: Mapping[str, str]) -> None:
        """Add texts about the run, to the present bag and to those to come."""
        self._notes.append((time.monotonic_ns(), {**self._notes[-1][1], **notes}))

    @property
    def writer(self) -> BagWriter | None:
        """The bag that is being written."""
        return self._writer

    def begin(self, folder: Path) -> None:
        """Begin a bag, with the last messages of latched topics from before it.

        Raises:
            RecorderError: The folder exists, or nothing can be written there.
        """
        channels = [
            jazzy_channel(
                self._full_names[topic.name],
                topic.type_name,
                depth=topic.depth,
                latched=topic.latched,
            )
            for topic in self._recorded
        ]
        try:
            writer = BagWriter(folder, channels, self._config, self._notes[-1][1])
            for topic, message, _ in self._latched.values():
                # As a subscription of now would have them: the bag does not begin before.
                now = max(message.arrived_ns, self._arrived_ns)
                writer.write(self._index[topic.name], message._replace(arrived_ns=now))
        except OSError as error:
            raise RecorderError(
                f"cannot record into {folder}: {error.strerror or error}"
            ) from error
        except BagError as error:
            raise RecorderError(str(error)) from error
        self._writer = writer
        self.folders.append(folder)
        for name in self.losses:
            self.losses[name] = LossCount()

    def take(self, topic: Topic, stamp_ns: int | None, taken: Taken) -> None:
        """Count a message and store it if a bag is being written.

        Args:
            topic: Its topic.
            stamp_ns: Its own [ns]; None where it has none.
            taken: The message.

        Raises:
            BagError: It has a time that no recording can hold; it is left out.
            OSError: As `BagWriter.write`.
        """
        # A stamp may be anything; what no recording can hold gives way to the time of sending.
        arrived = taken.arrived_at_ns
        times = (stamp_ns, taken.published_at_ns)
        published = next((t for t in times if t is not None and t >= 0), arrived)
        message = StoredMessage(taken.data, arrived, published, taken.number)
        message.check()
        self._arrived_ns = max(self._arrived_ns, message.arrived_ns)
        if topic.latched:
            self._latched[topic.name] = (topic, message, taken.received_ns)
        if topic.name in self.losses:
            self.losses[topic.name].take(taken.number)
        if self._writer is not None:
            self._writer.write(self._index[topic.name], message)

    def forget(self, before_ns: int) -> None:
        """Forget messages of latched topics from before a time of arrival, monotonic [ns]."""
        self._latched = {name: item for name, item in self._latched.items() if item[2] > before_ns}

    def end(self) -> None:
        """Close the bag, if there is one."""
        writer, self._writer = self._writer, None
        if writer is not None:
            self._close(writer, self._last_notes(""))

    def leave(self, answer: Answer, last_ns: int | None = None, *, failure: str = "") -> None:
        """Close the bag in a thread of its own: a slow disk must not hold the machine up.

        Args:
            answer: Called when it is closed: whether all is well, and a sentence.
            failure: Why it ends before the run; empty where it does not.
            last_ns: Arrival of its last message, monotonic [ns]; now by default. What was noted
                later is of another run.
        """
        writer, self._writer = self._writer, None
        if writer is None:
            answer(True, "nothing is being recorded")
            return
        notes = self._last_notes(failure, last_ns)

        def close() -> None:
            failure = self._close(writer, notes)
            size = f"{writer.taken} messages, {writer.stored} bytes"
            answer(failure is None, f"{writer.folder}: {failure or size}")

        closing = threading.Thread(target=close, name="recorder close", daemon=True)
        self._closings.append(closing)
        closing.start()

    @property
    def gone(self) -> bool:
        """Whether the bag that is being written was removed meanwhile."""
        return self._writer is not None and not self._writer.present

    def present(self, first: int = 0) -> tuple[Path, ...]:
        """Return the bags from that number on of which there is still a file."""
        return tuple(folder for folder in self.folders[first:] if any(folder.glob("*.mcap")))

    def join(self) -> None:
        """Wait until every bag that was left is closed."""
        for closing in self._closings:
            closing.join()

    def _last_notes(self, failure: str, last_ns: int | None = None) -> dict[str, str]:
        noted = [notes for noted_ns, notes in self._notes if last_ns is None or noted_ns <= last_ns]
        lost = {
            f"{LOST}{self._full_names[name]}": str(count.lost)
            for name, count in self.losses.items()
        }
        refused = {
            f"{REFUSED}{self._full_names.get(name, name)}": sentence
            for name, sentence in self.refused.sentences("could not be stored").items()
        }
        return {**noted[-1], COMPLETE: failure or YES, **lost, **refused}

    def _close(self, writer: BagWriter, notes: Mapping[str, str]) -> Exception | None:
        try:
            writer.close(notes)
            if not writer.present:
                raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        except OSError as error:
            rest = f"the bag was not closed, `winding bag recover {writer.folder}` reads the rest"
            if not writer.present:
                rest = f"the bag {writer.folder} was removed"
            self.error = OSError(error.errno, f"{error.strerror or error}; {rest}")
            return self.error
        return None
