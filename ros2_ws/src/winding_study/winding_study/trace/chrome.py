"""A trace in the Trace Event Format, which Perfetto and chrome://tracing open."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.trace import Channel, Station, TraceEvent
from winding_study.trace.hops import LengthTrace, Way

_MICRO = 1.0e6
_VERBS = {
    TraceEvent.EXPOSED: "expose",
    TraceEvent.TAKEN: "take",
    TraceEvent.PUBLISHED: "publish",
}
# Rows of the viewer: the ways stand above the nodes.
_WAYS = {"camera": 1, "prediction": 2}
_FIRST_STATION = 10


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
    content = {"traceEvents": events, "displayTimeUnit": "ms"}
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
