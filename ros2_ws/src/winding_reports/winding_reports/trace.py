"""Where the time goes between an exposure and a corrected length.

The ways to each corrected length are put together from what the nodes noted on their own. They are
summed up hop by hop, and written in the Trace Event Format, which Perfetto and chrome://tracing
open.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.trace import STAMPED_BY_CLOCK, Channel, Station, TraceEvent

Floats = NDArray[np.float64]
_Key = tuple[int, int, int]
_TO_THE_LENGTH = ("correction: compute", "correction: publish length")
_MICRO = 1.0e6
_VERBS = {TraceEvent.EXPOSED: "expose", TraceEvent.TAKEN: "take", TraceEvent.PUBLISHED: "publish"}
# Rows of the viewer: the ways stand above the nodes.
_WAYS = {"camera": 1, "prediction": 2}
_FIRST_STATION = 10


@dataclass(frozen=True, kw_only=True)
class Hop:
    """One part of a way."""

    name: str  # What happens in it
    station: str  # Where


@dataclass(frozen=True, kw_only=True)
class Way:
    """How long each corrected length was on its way, hop by hop."""

    name: str  # Where it comes from
    hops: tuple[Hop, ...]  # Its parts in their order, k of them
    stamps: Floats  # Of the corrected lengths [s], shape (n,)
    # Beginning of each hop, and the end of the last, since 1970 [s], shape (n, k + 1).
    instants: Floats

    @property
    def durations(self) -> Floats:
        """Of each hop [s], shape (n, k)."""
        return np.diff(self.instants, axis=1)

    @property
    def whole(self) -> Floats:
        """From the beginning of the first hop to the end of the last [s], shape (n,)."""
        whole: Floats = self.instants[:, -1] - self.instants[:, 0]
        return whole


def _hops(*names: str) -> tuple[Hop, ...]:
    split = (name.split(": ") for name in names)
    return tuple(Hop(station=station, name=name) for station, name in split)


CAMERA_HOPS = _hops(
    "camera: expose and read out",
    "camera: publish frame",
    "DDS: frame",
    "tracker: queue",
    "tracker: wait for encoder",
    "tracker: measure",
    "tracker: publish markers",
    "DDS: markers",
    "correction: queue",
    "correction: take markers",
    "correction: wait for prediction",
    *_TO_THE_LENGTH,
)
PREDICTION_HOPS = _hops(
    "DDS: joint states",
    "solver: queue",
    "solver: step",
    "solver: publish prediction",
    "DDS: prediction",
    "correction: queue",
    *_TO_THE_LENGTH,
)


@dataclass(frozen=True, kw_only=True)
class LengthTrace:
    """Both ways to the corrected lengths of a run."""

    camera: Way  # From the exposure of the newest frame that a length rests on
    prediction: Way  # From the encoder sample that its prediction is of
    lengths: int  # Messages with corrected lengths that were published

    @property
    def ways(self) -> tuple[Way, ...]:
        """Both."""
        return self.camera, self.prediction


def length_trace(records: NDArray[np.void]) -> LengthTrace:
    """Return the ways to each corrected length of which every node noted its part.

    Args:
        records: TRACE_DTYPE, shape (n,), of all nodes in any order.
    """
    events = _Events(records)
    published = events.all(TraceEvent.PUBLISHED, Channel.CORRECTED, Station.CORRECTION)
    camera: list[tuple[float, list[float]]] = []
    prediction: list[tuple[float, list[float]]] = []
    for corrected in published:
        for found, begin in ((camera, _camera_way), (prediction, _prediction_way)):
            with suppress(_NotNotedError):
                taken = events.last(
                    *(TraceEvent.TAKEN, Channel.PREDICTED, Station.CORRECTION),
                    *(corrected.ended, corrected.stamp),
                )
                ending = [taken.began, corrected.began, corrected.ended]
                found.append((corrected.stamp, begin(events, taken) + ending))
    return LengthTrace(
        camera=_way("camera", CAMERA_HOPS, camera),
        prediction=_way("prediction", PREDICTION_HOPS, prediction),
        lengths=len(published),
    )


class _NotNotedError(LookupError):
    """No node has noted what is asked for."""


def _camera_way(events: _Events, taken: np.record) -> list[float]:
    """Return the beginnings of a length's hops up to the wait for the prediction."""
    heard = events.last(TraceEvent.TAKEN, Channel.TRACKED, Station.CORRECTION, taken.began)
    markers = events.last(
        *(TraceEvent.PUBLISHED, Channel.TRACKED, Station.TRACKER), heard.began, heard.stamp
    )
    frame = events.last(
        *(TraceEvent.TAKEN, Channel.FRAME, Station.TRACKER), markers.began, heard.stamp
    )
    return [
        *_exposed(events, frame),
        *(frame.sent, frame.arrived, frame.began),
        _work_began(events, frame, markers.began),
        markers.began,
        *(heard.sent, heard.arrived, heard.began, heard.ended),
    ]


def _exposed(events: _Events, frame: np.record) -> list[float]:
    """Return when a frame shows the machine, and when it was handed to DDS."""
    stamp, sent = frame.stamp, frame.sent
    # A camera in the tracker's process hands its frames over and publishes few of them.
    for station in (Station.RIG, Station.TRACKER):
        with suppress(_NotNotedError):
            shown = events.last(TraceEvent.EXPOSED, Channel.FRAME, station, sent, stamp)
            with suppress(_NotNotedError):
                key = TraceEvent.PUBLISHED, Channel.FRAME, Station.RIG
                return [shown.began, events.last(*key, sent, stamp).began]
            return [shown.began, sent]
    ahead = events.camera_ahead(stamp)
    exposed = stamp - (ahead or 0.0)
    # A frame is sent after its exposure; what the tracker knows of the clock errs by a little.
    if ahead is not None and exposed > sent > exposed - STAMPED_BY_CLOCK:
        exposed = sent
    if not 0.0 <= sent - exposed < STAMPED_BY_CLOCK:
        raise _NotNotedError
    return [exposed, sent]


def _work_began(events: _Events, frame: np.record, measured: float) -> float:
    """Return when the tracker began to measure a frame that may have waited for the encoder."""
    if measured <= frame.ended:
        return float(frame.began)
    with suppress(_NotNotedError):
        sample = events.last(TraceEvent.TAKEN, Channel.JOINT_STATES, Station.TRACKER, measured)
        return float(max(sample.began, frame.began))
    return measured


def _prediction_way(events: _Events, taken: np.record) -> list[float]:
    """Return the beginnings of a length's hops from the encoder sample on."""
    predicted = events.last(
        *(TraceEvent.PUBLISHED, Channel.PREDICTED, Station.SOLVER), taken.began, taken.stamp
    )
    sample = events.last(TraceEvent.TAKEN, Channel.JOINT_STATES, Station.SOLVER, predicted.began)
    return [sample.sent, sample.arrived, sample.began, predicted.began, taken.sent, taken.arrived]


def _way(name: str, hops: tuple[Hop, ...], found: Sequence[tuple[float, list[float]]]) -> Way:
    return Way(
        name=name,
        hops=hops,
        stamps=np.array([stamp for stamp, _ in found]),
        instants=np.array([instants for _, instants in found]).reshape(-1, len(hops) + 1),
    )


class _Events:
    """Records by kind, and by kind and stamp, in the order in which they began."""

    def __init__(self, records: NDArray[np.void]) -> None:
        self._rows: dict[tuple[_Key, float | None], list[np.record]] = defaultdict(list)
        for row in _in_order(records):
            for stamp in (None, row.stamp):
                self._rows[(row.event, row.channel, row.station), stamp].append(row)
        shown = self.all(TraceEvent.EXPOSED, Channel.FRAME, Station.TRACKER)
        self._ahead = sorted(
            (row.stamp, row.stamp - row.began)
            for row in shown
            if abs(row.stamp - row.began) < STAMPED_BY_CLOCK
        )

    def all(self, event: int, channel: int, station: int) -> list[np.record]:
        """Return the records of a kind."""
        return self._rows[(event, channel, station), None]

    def last(
        self, event: int, channel: int, station: int, before: float, stamp: float | None = None
    ) -> np.record:
        """Return the last record of a kind, or of one stamp [s], that began before a time [s].

        Raises:
            _NotNotedError: There is none.
        """
        rows = self._rows.get(((event, channel, station), stamp), ())
        count = bisect_right(rows, before, key=attrgetter("began"))
        if not count:
            raise _NotNotedError
        return rows[count - 1]

    def camera_ahead(self, stamp: float) -> float | None:
        """Return how far a camera's clock is ahead at a stamp [s], as far as the tracker knew.

        What it did not know yet it knew with the first frame after that; None where it never did.
        """
        at = bisect_left(self._ahead, (stamp, -math.inf))
        return self._ahead[min(at, len(self._ahead) - 1)][1] if self._ahead else None


@dataclass(frozen=True, kw_only=True)
class HopCost:
    """What one hop, or the whole way, takes over all lengths of a run."""

    station: str  # Where; empty for the whole
    name: str  # What happens in it
    median: float  # [s]
    p99: float  # 99 of 100 take less [s]
    share: float  # Of the mean whole


def hop_costs(way: Way) -> tuple[HopCost, ...]:
    """Return what each hop of a way costs, the whole last; nothing for a way without lengths."""
    if len(way.stamps) == 0:
        return ()
    mean = float(way.whole.mean())
    columns = [
        *((hop.station, hop.name, way.durations[:, k]) for k, hop in enumerate(way.hops)),
        ("", "whole", way.whole),
    ]
    return tuple(
        HopCost(
            station=station,
            name=name,
            median=float(np.median(taken)),
            p99=float(np.percentile(taken, 99.0)),
            share=float(taken.mean()) / mean,
        )
        for station, name, taken in columns
    )


def write_chrome_trace(trace: LengthTrace, records: NDArray[np.void], path: Path) -> None:
    """Write what the nodes noted, and the ways to the corrected lengths, as one JSON file.

    Args:
        trace: The ways.
        records: TRACE_DTYPE, shape (n,).
        path: File.
    """
    origin = float(records["began"].min()) if len(records) else 0.0
    events = [
        *_names(),
        *_way_events(trace.camera, origin),
        *_way_events(trace.prediction, origin),
        *_node_events(records, origin),
    ]
    # Viewers show it as it is: of how many lengths each way is known.
    counts = {"lengths": trace.lengths} | {way.name: len(way.stamps) for way in trace.ways}
    content = {"traceEvents": events, "displayTimeUnit": "ms", "otherData": counts}
    path.write_text(json.dumps(content, separators=(",", ":")) + "\n", encoding="utf-8")


def _names() -> Iterator[dict[str, Any]]:
    rows = {f"length by {name}": number for name, number in _WAYS.items()}
    rows |= {station.name.lower(): _FIRST_STATION + station for station in Station}
    for name, number in rows.items():
        yield {"ph": "M", "name": "process_name", "pid": number, "args": {"name": name}}
        yield {
            "ph": "M",
            "name": "process_sort_index",
            "pid": number,
            "args": {"sort_index": number},
        }


def _way_events(way: Way, origin: float) -> Iterator[dict[str, Any]]:
    """Yield each length as a slice that holds its hops; lengths overlap, so they have ids."""
    number = _WAYS[way.name]
    for index, (stamp, instants) in enumerate(zip(way.stamps, way.instants, strict=True)):
        head = {"cat": way.name, "id": index, "pid": number, "tid": number}
        whole = {"name": "corrected length", "args": {"stamp_s": stamp}}
        times = [round(_MICRO * (instant - origin), 1) for instant in instants.tolist()]
        yield {"ph": "b", "ts": times[0], **head, **whole}
        for hop, begin, end in zip(way.hops, times[:-1], times[1:], strict=True):
            name = f"{hop.station}: {hop.name}"
            yield {"ph": "b", "ts": begin, "name": name, **head}
            yield {"ph": "e", "ts": end, "name": name, **head}
        yield {"ph": "e", "ts": times[-1], "name": "corrected length", **head}


def _node_events(records: NDArray[np.void], origin: float) -> Iterator[dict[str, Any]]:
    """Yield what each node did; what it publishes lies within what it takes.

    Viewers draw slices of a row that lie within each other, not those that overlap: what a
    second thread does at the same time gets a row of its own.
    """
    open_ends: dict[int, list[list[float]]] = defaultdict(list)
    for row in _in_order(records):
        yield {
            "ph": "X",
            "name": f"{_VERBS[TraceEvent(row.event)]} {Channel(row.channel).name.lower()}",
            "pid": int(_FIRST_STATION + row.station),
            "tid": _free_row(open_ends[row.station], row.began, row.ended),
            "ts": round(_MICRO * (row.began - origin), 1),
            "dur": round(_MICRO * (row.ended - row.began), 1),
            "args": {"stamp_s": row.stamp},
        }


def _in_order(records: NDArray[np.void]) -> Iterator[np.record]:
    """Yield records in the order in which they began, their fields as attributes."""
    yield from records[np.argsort(records["began"], kind="stable")].view(np.recarray)


def _free_row(rows: list[list[float]], begin: float, end: float) -> int:
    """Return the number of the first row, from 1, in which a slice overlaps no other.

    Args:
        rows: Ends of the slices that are open in each, outermost first; this one is added.
        begin: Of the slice, not before those that came earlier.
        end: Of the slice.
    """
    for number, ends in enumerate(rows, start=1):
        while ends and ends[-1] <= begin:
            ends.pop()
        if not ends or end <= ends[-1]:
            ends.append(end)
            return number
    rows.append([end])
    return len(rows)
