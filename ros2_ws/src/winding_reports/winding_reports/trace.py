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
from dataclasses import dataclass
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
        stamp, end = float(corrected["stamp"]), float(corrected["ended"])
        taken = events.last(TraceEvent.TAKEN, Channel.PREDICTED, Station.CORRECTION, end, stamp)
        if taken is None:
            continue
        ending = [float(taken["began"]), float(corrected["began"]), end]
        for found, begin in (
            (camera, _camera_way(events, taken)),
            (prediction, _prediction_way(events, taken)),
        ):
            if begin is not None:
                found.append((stamp, begin + ending))
    return LengthTrace(
        camera=_way("camera", CAMERA_HOPS, camera),
        prediction=_way("prediction", PREDICTION_HOPS, prediction),
        lengths=len(published),
    )


def _camera_way(events: _Events, taken: np.void) -> list[float] | None:
    """Return the beginnings of a length's hops up to the wait for the prediction."""
    heard = events.last(
        TraceEvent.TAKEN, Channel.TRACKED, Station.CORRECTION, float(taken["began"])
    )
    if heard is None:
        return None
    stamp = float(heard["stamp"])
    markers = events.last(
        TraceEvent.PUBLISHED, Channel.TRACKED, Station.TRACKER, float(heard["began"]), stamp
    )
    if markers is None:
        return None
    measured = float(markers["began"])
    frame = events.last(TraceEvent.TAKEN, Channel.FRAME, Station.TRACKER, measured, stamp)
    if frame is None:
        return None
    exposed = _exposed(events, frame)
    if exposed is None:
        return None
    return [
        *exposed,
        float(frame["sent"]),
        float(frame["arrived"]),
        float(frame["began"]),
        _work_began(events, frame, measured),
        measured,
        float(heard["sent"]),
        float(heard["arrived"]),
        float(heard["began"]),
        float(heard["ended"]),
    ]


def _exposed(events: _Events, frame: np.void) -> list[float] | None:
    """Return when a frame shows the machine, and when it was handed to DDS."""
    stamp, sent = float(frame["stamp"]), float(frame["sent"])
    shown = events.last(TraceEvent.EXPOSED, Channel.FRAME, Station.RIG, sent, stamp)
    if shown is None:
        # A camera in the tracker's process hands its frames over and publishes few of them.
        shown = events.last(TraceEvent.EXPOSED, Channel.FRAME, Station.TRACKER, sent, stamp)
    if shown is not None:
        handed = events.last(TraceEvent.PUBLISHED, Channel.FRAME, Station.RIG, sent, stamp)
        return [float(shown["began"]), sent if handed is None else float(handed["began"])]
    ahead = events.camera_ahead(stamp)
    exposed = stamp - (ahead or 0.0)
    # A frame is sent after its exposure; what the tracker knows of the clock errs by a little.
    if ahead is not None and exposed > sent > exposed - STAMPED_BY_CLOCK:
        exposed = sent
    return [exposed, sent] if 0.0 <= sent - exposed < STAMPED_BY_CLOCK else None


def _work_began(events: _Events, frame: np.void, measured: float) -> float:
    """Return when the tracker began to measure a frame that may have waited for the encoder."""
    if measured <= float(frame["ended"]):
        return float(frame["began"])
    sample = events.last(TraceEvent.TAKEN, Channel.JOINT_STATES, Station.TRACKER, measured)
    return measured if sample is None else max(float(sample["began"]), float(frame["began"]))


def _prediction_way(events: _Events, taken: np.void) -> list[float] | None:
    """Return the beginnings of a length's hops from the encoder sample on."""
    predicted = events.last(
        TraceEvent.PUBLISHED,
        Channel.PREDICTED,
        Station.SOLVER,
        float(taken["began"]),
        float(taken["stamp"]),
    )
    if predicted is None:
        return None
    sample = events.last(
        TraceEvent.TAKEN, Channel.JOINT_STATES, Station.SOLVER, float(predicted["began"])
    )
    if sample is None:
        return None
    return [
        float(sample["sent"]),
        float(sample["arrived"]),
        float(sample["began"]),
        float(predicted["began"]),
        float(taken["sent"]),
        float(taken["arrived"]),
    ]


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
        self._rows: dict[tuple[_Key, float | None], list[np.void]] = defaultdict(list)
        self._began: dict[tuple[_Key, float | None], list[float]] = defaultdict(list)
        for row in records[np.argsort(records["began"], kind="stable")]:
            key = (int(row["event"]), int(row["channel"]), int(row["station"]))
            for stamp in (None, float(row["stamp"])):
                self._rows[key, stamp].append(row)
                self._began[key, stamp].append(float(row["began"]))
        shown = (int(TraceEvent.EXPOSED), int(Channel.FRAME), int(Station.TRACKER))
        self._ahead = sorted(
            (float(row["stamp"]), ahead)
            for row in self._rows.get((shown, None), ())
            if abs(ahead := float(row["stamp"] - row["began"])) < STAMPED_BY_CLOCK
        )

    def all(self, *key: int) -> list[np.void]:
        """Return the records of a kind."""
        event, channel, station = key
        return self._rows[(event, channel, station), None]

    def last(
        self, event: int, channel: int, station: int, before: float, stamp: float | None = None
    ) -> np.void | None:
        """Return the last record of a kind, or of one stamp [s], that began before a time [s]."""
        key = ((event, channel, station), stamp)
        count = bisect_right(self._began.get(key, ()), before)
        return self._rows[key][count - 1] if count else None

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
    for row in records[np.argsort(records["began"], kind="stable")]:
        event = TraceEvent(int(row["event"]))
        begin, end = float(row["began"]), float(row["ended"])
        yield {
            "ph": "X",
            "name": f"{_VERBS[event]} {Channel(int(row['channel'])).name.lower()}",
            "pid": _FIRST_STATION + int(row["station"]),
            "tid": _free_row(open_ends[int(row["station"])], begin, end),
            "ts": round(_MICRO * (begin - origin), 1),
            "dur": round(_MICRO * (end - begin), 1),
            "args": {"stamp_s": float(row["stamp"])},
        }


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
