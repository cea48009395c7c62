"""Messages of a run in memory, for those who follow it and for its report."""

from __future__ import annotations

import threading
from array import array
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2

from winding_core.history import History
from winding_core.machine.axes import MachineAxes
from winding_core.machine.readings import AxisReading
from winding_core.run_inputs import AXES, INPUT_DTYPE, RunInputs
from winding_core.status import Status
from winding_ros import topics
from winding_ros.messages.rig import JointStateReader
from winding_ros.messages.serialised import MessageError, deserialised
from winding_ros.topic import Topic

Reading = TypeVar("Reading")

PICTURES = (topics.IMAGE, topics.PREVIEW)
# Simulated time of which the buffer has every message, and of which it keeps as many before that.
_WHOLE_S, _SAMPLE_S = 10.0, 20.0
_FEWEST = 200
_SLOPE_SAMPLES = 50  # The newest joint states that speeds are taken from


class BufferedMessage(NamedTuple):
    """One serialised message."""

    stamp_ns: int  # Its own stamp [ns]
    sent_ns: int  # Monotonic wall time at which its publisher sent it [ns]
    received_ns: int  # Monotonic wall time of its arrival [ns]
    data: bytes  # CDR bytes


class StampRuns:
    """Every stamp of a topic, held as runs of equal steps: a steady topic takes no memory."""

    def __init__(self, step_ns: int) -> None:
        self._step_ns = step_ns
        self._first, self._last = array("q"), array("q")

    def add(self, stamp_ns: int) -> None:
        """Take a stamp [ns]."""
        if self._last and stamp_ns - self._last[-1] == self._step_ns:
            self._last[-1] = stamp_ns
        else:
            self._first.append(stamp_ns)
            self._last.append(stamp_ns)

    def without_last(self, count: int) -> StampRuns:
        """Return runs of their own of all stamps but so many of the newest."""
        runs = StampRuns(self._step_ns)
        stamps = self.stamps()
        for stamp in stamps[: len(stamps) - count].tolist():
            runs.add(stamp)
        return runs

    def stamps(self) -> NDArray[np.int64]:
        """Return all stamps [ns] in the order they came, shape (n,)."""
        runs = [
            np.arange(first, last + 1, self._step_ns, dtype=np.int64)
            for first, last in zip(self._first, self._last, strict=True)
        ]
        return np.concatenate(runs) if runs else np.zeros(0, dtype=np.int64)


class RunBuffer:
    """Messages of a run in memory, by topic name; of pictures only the newest stamp.

    All of them for 40 s of simulated time. Of a longer run the last 10 s are whole and what was
    before them is thinned, so that memory does not grow with the run; the stamps stay complete.
    """

    def __init__(self, recorded: Iterable[Topic]) -> None:
        # Stamp at which the run begins [s], infinite while a real machine stands before it; a reset
        # leaves time as it is.
        self.origin = 0.0
        self.axes = MachineAxes()  # How the joint states of its machine are read
        self.begun_ns = 0  # What arrived before is of earlier runs, monotonic wall time [ns]
        self._lock = threading.Lock()
        self._pictured_ns: dict[str, int] = {}
        self._kept = kept = [topic for topic in recorded if topic not in PICTURES]
        # By topic name.
        self.messages: dict[str, History[BufferedMessage]] = {
            topic.name: History(newest=_room(topic, _WHOLE_S), older=_room(topic, _SAMPLE_S))
            for topic in kept
        }
        self._stamps = {
            topic.name: StampRuns(round(1e9 / topic.rate)) for topic in kept if topic.rate
        }

    def add(self, topic: Topic, message: BufferedMessage) -> None:
        """Take a message; a picture itself is left to the bag."""
        name = topic.name
        if topic in PICTURES:
            self._pictured_ns[name] = message.stamp_ns
            return
        with self._lock:
            self.messages[name].append(message)
            if name in self._stamps:
                self._stamps[name].add(message.stamp_ns)

    def begin_anew(self, cut_ns: int, origin: float) -> None:
        """Forget the runs before the present one; the last of a latched topic stays.

        Args:
            cut_ns: What arrived before is forgotten, monotonic wall time [ns].
            origin: Simulated time at which the present run begins [s].
        """
        with self._lock:
            self.origin = origin
            self.begun_ns = cut_ns
            self._pictured_ns.clear()
            for topic in self._kept:
                old = self.messages[topic.name]
                later = [message for message in old if message.received_ns >= cut_ns]
                if topic.latched and not later:
                    later = old[-1:]
                self.messages[topic.name] = old.rewound(later)
                if topic.rate:
                    self._stamps[topic.name] = StampRuns(round(1e9 / topic.rate))
                    for message in later:
                        self._stamps[topic.name].add(message.stamp_ns)

    def before(self, cut_ns: int | None = None) -> RunBuffer:
        """Return a buffer of its own of what came before a moment, which nothing is added to.

        Args:
            cut_ns: Monotonic wall time [ns]; None for everything so far.
        """
        with self._lock:
            copy = RunBuffer(self._kept)
            copy.origin, copy.axes, copy.begun_ns = self.origin, self.axes, self.begun_ns
            for topic in self._kept:
                old = self.messages[topic.name]
                kept = old.only(lambda item: cut_ns is None or item.received_ns < cut_ns)
                copy.messages[topic.name] = kept
                if topic.rate:
                    stamps = self._stamps[topic.name]
                    copy._stamps[topic.name] = stamps.without_last(len(old) - len(kept))
        return copy

    def stamps(self, topic: Topic) -> NDArray[np.int64]:
        """Return every stamp [ns] that came on a topic with a rate, shape (n,)."""
        runs = self._stamps.get(topic.name)
        return np.zeros(0, dtype=np.int64) if runs is None else runs.stamps()

    @property
    def thinned(self) -> bool:
        """Whether the run has become too long for all its messages."""
        return any(history.stride > 1 for history in self.messages.values())

    def last(self, topic: Topic) -> BufferedMessage | None:
        """Return the newest message of a topic."""
        messages = self.messages.get(topic.name)
        return messages[-1] if messages else None

    def last_stamp(self, topic: Topic) -> float:
        """Return the newest stamp of a topic [s], or -1 when there is none yet."""
        message = self.last(topic)
        stamp_ns = message.stamp_ns if message else self._pictured_ns.get(topic.name)
        return -1.0 if stamp_ns is None else stamp_ns * 1e-9

    @property
    def time(self) -> float:
        """Time of the run that the encoder has reached [s]; 0 while it has not begun."""
        return max(self.last_stamp(topics.JOINT_STATES) - self.origin, 0.0)

    def readings(self, topic: Topic, since: float = 0.0) -> Iterator[tuple[float, Any]]:
        """Yield (t [s], content) of a topic's messages.

        Those that cannot be used are left out: the nodes that read them live refuse the same.

        Args:
            topic: Whose messages.
            since: Leaves out what came before this monotonic wall time [s].
        """
        return self._decoded(topic, partial(_content, topic), since)

    def statuses(self) -> Iterator[Status]:
        """Yield every status of /diagnostics."""
        for _, statuses in self.readings(topics.DIAGNOSTICS):
            yield from statuses

    def axis_readings(self, since: float = 0.0) -> Iterator[tuple[float, AxisReading]]:
        """Yield (t [s], reading) of the usable joint states.

        Args:
            since: Leaves out what came before this monotonic wall time [s].
        """
        return self._decoded(topics.JOINT_STATES, JointStateReader(self.axes), since)

    def _decoded(
        self, topic: Topic, decode: Callable[[bytes], Reading], since: float
    ) -> Iterator[Reading]:
        for message in self.messages.get(topic.name, ()):
            if message.received_ns * 1e-9 < since:
                continue
            try:
                yield decode(message.data)
            except MessageError:
                continue

    def newest_axis_reading(self) -> tuple[float, AxisReading] | None:
        """Return (t [s], reading) of the last usable joint state; None before the first."""
        messages = self.messages[topics.JOINT_STATES.name]
        # Speeds that are not reported are slopes over the last samples.
        count, found = _SLOPE_SAMPLES, None
        while found is None:
            read, window = JointStateReader(self.axes), messages.newest(count)
            for message in window:
                try:
                    found = read(message.data)
                except MessageError:
                    continue
            if len(window) < count:
                break
            count *= 4
        return found

    def newest(self, topic: Topic) -> Any:
        """Return the content of the last usable message of a topic; None before the first."""
        for message in reversed(self.messages.get(topic.name, ())):
            try:
                return _content(topic, message.data)[1]
            except MessageError:
                continue
        return None


def _content(topic: Topic, data: bytes) -> tuple[float, Any]:
    # Clouds, which are many and long, are read from their bytes.
    cloud = topic.type is PointCloud2
    return topic.decode(data if cloud else deserialised(data, topic.type))


def _room(topic: Topic, span: float) -> int:
    return max(round((topic.rate or 0.0) * span), _FEWEST)


def buffered_inputs(buffer: RunBuffer, since: float = 0.0) -> RunInputs:
    """Return the usable encoder samples with the tension that was the newest then.

    The buffer of a long run is thinned. A model follows a cubic between samples, which a winding
    machine leaves by less than its encoder's step.

    Args:
        buffer: Messages of the graph.
        since: Leaves out what came before this monotonic wall time [s].
    """
    readings = list(buffer.axis_readings(since))
    tensions = list(buffer.readings(topics.TENSION, since))
    samples = np.full(len(readings), np.nan, dtype=INPUT_DTYPE)
    samples["t"] = [t for t, _ in readings]
    for name in AXES:
        samples[name] = [getattr(reading, name) for _, reading in readings]
    for k, (_, reading) in enumerate(readings):
        if reading.guide is not None:
            samples["guide_x"][k], samples["guide_y"][k] = reading.guide.x, reading.guide.y
    if tensions:
        times = np.array([t for t, _ in tensions])
        forces = np.array([force for _, force in tensions])
        newest = np.searchsorted(times, samples["t"], side="right") - 1
        samples["tension"] = np.where(newest >= 0, forces[np.maximum(newest, 0)], np.nan)
    return RunInputs(samples=samples)
