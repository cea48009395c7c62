"""Put a recorded run to one node's work again, without ROS around it."""

from __future__ import annotations

import hashlib
import heapq
import importlib
import math
from bisect import insort
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from rosbags.highlevel import AnyReader

from winding_recorder.bags.contents import configuration_of, recorded_parameters
from winding_recorder.bags.description import BagError
from winding_recorder.bags.reading import Decoder, opened, stamped_messages
from winding_recorder.bags.tables import Row, rows_of
from winding_ros import topics
from winding_ros.graph import COMPRESSED_TRACKER, CORRECTION, FEM, TRACKER, NodeSpec, parameters_of
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import decode_stamp, serialised_stamp_ns
from winding_ros.runtime.message_handler import Answer, MessageHandler
from winding_ros.topic import Topic

Stream = Mapping[int, Sequence[bytes]]
# What a person calls the node -> the node.
REPLAYABLE = {"tracker": TRACKER, "fem": FEM, "correction": CORRECTION}
DEFAULT_TOLERANCE = 1.0e-6
_NANO = 1_000_000_000
# Encoder samples of the last second before a node's first message belong to it [ns].
_BEFORE = _NANO
_ROUNDING = 1000  # Stamps since the epoch, carried as seconds [ns]


@dataclass(kw_only=True)
class Comparison:
    """Answers of a replay beside the recorded ones, for one topic."""

    topic: str  # Full topic name
    compared: int = 0  # Messages with the same stamp on both sides
    identical: int = 0  # Those whose bytes are the same
    missing: int = 0  # Recorded, but not given by the replay
    extra: int = 0  # Given by the replay, but not recorded
    # Largest absolute difference by numeric field, in the field's unit.
    differences: dict[str, float] = field(default_factory=dict)
    # Largest difference over what the tolerance allows, by field; above 1 is too much.
    excess: dict[str, float] = field(default_factory=dict)
    # Fields of text, or numbers of rows, that differ, with how often.
    mismatches: dict[str, int] = field(default_factory=lambda: defaultdict(int))

    @property
    def agrees(self) -> bool:
        """Whether everything recorded came again, within the tolerance."""
        return not (
            self.missing
            or self.extra
            or self.mismatches
            or any(not excess <= 1.0 for excess in self.excess.values())
        )


def compare(
    topic: str, type_name: str, recorded: Stream, replayed: Stream, *, tolerance: float
) -> Comparison:
    """Compare messages of the same stamps.

    Args:
        topic: Full topic name.
        type_name: Of both streams.
        recorded: Stamp [ns] -> serialised messages, in order.
        replayed: The same of the replay.
        tolerance: Allowed difference, relative to the recorded value or to 1 if that is larger.
    """
    result = Comparison(topic=topic)
    decoder = Decoder()
    for stamp in sorted(recorded.keys() | replayed.keys()):
        before, after = recorded.get(stamp, ()), replayed.get(stamp, ())
        result.missing += max(0, len(before) - len(after))
        result.extra += max(0, len(after) - len(before))
        for one, other in zip(before, after, strict=False):
            result.compared += 1
            if one == other:
                result.identical += 1
            else:
                _compare_rows(
                    rows_of(stamp, decoder.decode(type_name, one)),
                    rows_of(stamp, decoder.decode(type_name, other)),
                    tolerance,
                    result,
                )
    return result


def _compare_rows(one: list[Row], other: list[Row], tolerance: float, result: Comparison) -> None:
    if len(one) != len(other):
        result.mismatches["rows"] += 1
        return
    for before, after in zip(one, other, strict=True):
        for name in before.keys() | after.keys():
            _compare_values(name, before.get(name), after.get(name), tolerance, result)


def _compare_values(
    name: str, before: object, after: object, tolerance: float, result: Comparison
) -> None:
    if not (isinstance(before, int | float) and isinstance(after, int | float)):
        if before != after:
            result.mismatches[name] += 1
        return
    if math.isnan(before) and math.isnan(after):
        return
    difference = abs(after - before)
    excess = difference / (tolerance * max(1.0, abs(before))) if difference else 0.0
    result.differences[name] = _worse(result.differences.get(name, 0.0), difference)
    result.excess[name] = _worse(result.excess.get(name, 0.0), excess)


def _worse(one: float, other: float) -> float:
    # NaN on one side only is the worst of all, and stays.
    return one if math.isnan(one) or one >= other else other


@dataclass(frozen=True, kw_only=True)
class Replay:
    """What a replay gave."""

    inputs: int  # Messages that were put in
    refused: int  # Those that the node's work refused
    digest: str  # SHA-256 over all answers in order; equal for equal replays
    comparisons: tuple[Comparison, ...]  # With the recorded answers, by topic

    @property
    def agrees(self) -> bool:
        """Whether every recorded answer came again within the tolerance."""
        return all(comparison.agrees for comparison in self.comparisons)


def replay(
    path: Path,
    node: str,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    parameters: Mapping[str, Any] | None = None,
) -> Replay:
    """Feed a node's recorded inputs to its work, and compare with the recorded answers.

    Inputs go in by their stamps; those of one stamp in the order that the handler states. In
    the run, messages of different topics reached the node in the order of their arrival, which
    is that at the recorder only nearly.

    Args:
        path: The recording.
        node: One of REPLAYABLE.
        tolerance: Allowed difference, relative to the recorded value or to 1 if that is larger.
        parameters: In place of those that the recording brings.

    Raises:
        BagError: The recording cannot be read, or lacks the node's parameters or topics.
        ParameterError: A parameter is not one of the node's.
    """
    if node not in REPLAYABLE:
        raise BagError(f"node must be one of {', '.join(REPLAYABLE)}, got {node!r}")
    if not 0.0 < tolerance < float("inf"):
        raise BagError(f"tolerance must be positive and finite, got {tolerance:g}")
    name = REPLAYABLE[node].name
    try:
        values = recorded_parameters(path, name) if parameters is None else parameters
    except BagError as error:
        raise BagError(f"{error}; give --parameters") from error
    with opened(path) as reader:
        spec = _as_recorded(reader, REPLAYABLE[node])
        module = importlib.import_module(f"{spec.package}.ros.message_handler")
        links = {topic.name: _link(reader, topic) for topic in spec.inputs}
        stored = {topic.name: _link(reader, topic) for topic in spec.outputs}
        configuration: Any = configuration_of(parameters_of(spec), values, spec.name)
        handler: MessageHandler = getattr(module, spec.handler_class)(configuration)
        run = _Run(handler)
        recorded = {topic: _stream(reader, link, run.decoder) for topic, link in stored.items()}
        # A real machine goes on when the nodes have ended.
        open_ended = getattr(configuration, "await_motion", False)
        first, last = _span(recorded)
        begun = handler.begin(decode_stamp(Time(sec=first // _NANO, nanosec=first % _NANO)))
        # What is wound ahead piece by piece, and was ended with the run, is not wound further.
        run.answer(islice(begun, max(1, _count_at(recorded, first))))
        for topic, data in _inputs(reader, spec.inputs, links, first, last if open_ended else None):
            run.put(topic, data)
    if run.inputs == 0:
        raise BagError(f"{path} holds none of {node}'s inputs")
    return Replay(
        inputs=run.inputs,
        refused=run.refused,
        digest=run.digest.hexdigest(),
        comparisons=tuple(
            compare(
                link.topic,
                link.msgtype,
                recorded[topic],
                run.answers.get(topic, {}),
                tolerance=tolerance,
            )
            for topic, link in stored.items()
        ),
    )


class _Run:
    """Collects what a handler answers."""

    def __init__(self, handler: MessageHandler) -> None:
        self._handler = handler
        self.decoder = Decoder()
        self.inputs = self.refused = 0
        self.digest = hashlib.sha256()
        self.answers: dict[str, dict[int, list[bytes]]] = defaultdict(lambda: defaultdict(list))

    def put(self, topic: Topic, data: bytes) -> None:
        """Put one message in, as a node does: one that is refused is counted."""
        self.inputs += 1
        try:
            self.answer(self._handler.take(topic, data))
        except MessageError:
            self.refused += 1

    def answer(self, answers: Iterator[Answer]) -> None:
        """Take answers."""
        for answer in answers:
            data = self.decoder.canonical(answer.topic.type_name, answer.data)
            self.digest.update(answer.topic.name.encode())
            self.digest.update(data)
            self.answers[answer.topic.name][serialised_stamp_ns(data)].append(data)


def _as_recorded(reader: AnyReader, spec: NodeSpec) -> NodeSpec:
    """Return what a node was: a tracker with a frame for each answer may have had compressed ones.

    The preview of a camera whose raw frames were not recorded has fewer.
    """
    raw, frames, answers = (
        sum(link.msgcount for link in _links(reader, topic))
        for topic in (topics.IMAGE, topics.PREVIEW, topics.TRACKED_MARKERS)
    )
    return COMPRESSED_TRACKER if spec is TRACKER and not raw and frames >= answers else spec


def _links(reader: AnyReader, topic: Topic) -> list[Any]:
    return [link for link in reader.connections if f"/{link.topic}".endswith(f"/{topic.name}")]


def _link(reader: AnyReader, topic: Topic) -> Any:
    found = _links(reader, topic)
    if len(found) != 1:
        raise BagError(f"the recording must hold {topic.name} once, it holds {len(found)} of it")
    if found[0].msgtype != topic.type_name:
        raise BagError(f"{found[0].topic} must be {topic.type_name}, it is {found[0].msgtype}")
    return found[0]


def _stream(reader: AnyReader, link: Any, decoder: Decoder) -> dict[int, list[bytes]]:
    stream: dict[int, list[bytes]] = defaultdict(list)
    for _, stamp, _, data in stamped_messages(reader, [link]):
        stream[stamp].append(decoder.canonical(link.msgtype, data))
    return stream


def _span(recorded: Mapping[str, Mapping[int, Any]]) -> tuple[int, int]:
    """Return the stamps [ns] of the node's first message and of its last."""
    streams = [stream for stream in recorded.values() if stream]
    return min(map(min, streams), default=0), max(map(max, streams), default=0)


def _count_at(recorded: Mapping[str, Mapping[int, Sequence[bytes]]], stamp: int) -> int:
    """Return how many messages of a stamp [ns] on topics without a rate were recorded."""
    on_change = {topic.name for topic in topics.TOPICS if topic.rate is None}
    return sum(len(stream.get(stamp, ())) for name, stream in recorded.items() if name in on_change)


def _inputs(
    reader: AnyReader,
    inputs: Sequence[Topic],
    links: Mapping[str, Any],
    first: int,
    last: int | None,
) -> Iterator[tuple[Topic, bytes]]:
    """Yield the node's inputs in order; a real machine published long before the node was there.

    Args:
        reader: Of the recording.
        inputs: Topics, in the order in which the node takes those of one stamp.
        links: Of the recording, by topic.
        first: Stamp of the node's first message [ns].
        last: Stamp of its last message [ns], where inputs go on after it; None otherwise.
    """
    # A tracker answers frames, and needs the encoder beyond the last of them.
    frames = {topics.IMAGE, topics.PREVIEW}.intersection(inputs)

    def relevant(topic: Topic, stamp: int) -> bool:
        if topic in frames and stamp < first - _ROUNDING:
            return False
        if last is not None and (not frames or topic in frames) and stamp > last + _ROUNDING:
            return False
        return stamp >= first - _BEFORE

    def stream(topic: Topic) -> Iterator[tuple[int, Topic, bytes]]:
        found = stamped_messages(reader, [links[topic.name]])
        return ((stamp, topic, data) for _, stamp, _, data in found)

    # Of equal stamps, those of the topic that the node takes first come first.
    for stamp, topic, data in heapq.merge(
        *(_in_step(stream(topic)) for topic in inputs), key=itemgetter(0)
    ):
        if relevant(topic, stamp):
            yield topic, data


def _in_step(stream: Iterator[tuple[int, Topic, bytes]]) -> Iterator[tuple[int, Topic, bytes]]:
    """Yield a topic's messages in the order of arrival, those far ahead when their time comes.

    A message is ahead when the next one is older: on its own it would hold back all behind it.
    """
    ahead: list[tuple[int, Topic, bytes]] = []
    for item, following in pairwise(chain(stream, [None])):
        assert item is not None
        if following is not None and following[0] < item[0]:
            insort(ahead, item, key=itemgetter(0))
            continue
        while ahead and ahead[0][0] <= item[0]:
            yield ahead.pop(0)
        yield item
    yield from ahead
