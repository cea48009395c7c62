"""What the parts of a way cost: one row for each hop, and one for the whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from winding_study.trace.hops import Way


@dataclass(frozen=True, kw_only=True)
class HopCost:
    """What one hop, or the whole way, takes over all lengths of a run.

    Attributes:
        station: Where; empty for the whole.
        name: What happens in it.
        median: [s]
        p99: 99 of 100 take less [s].
        share: Of the mean whole.
    """

    station: str
    name: str
    median: float
    p99: float
    share: float


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
