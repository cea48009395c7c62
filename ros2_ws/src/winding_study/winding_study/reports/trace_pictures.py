"""Picture of where the time goes between an exposure and a corrected length."""

from __future__ import annotations

import numpy as np

from winding_core.units import MILLISECOND
from winding_study.documents.picture import PALE, PREDICTED, Picture, canvas, picture
from winding_study.trace.hops import LengthTrace
from winding_study.trace.summary import hop_costs

_TITLES = {
    "camera": "from the exposure of the newest frame, ms",
    "prediction": "from the encoder sample, ms",
}


def trace_picture(trace: LengthTrace) -> Picture:
    """Return median and 99th percentile of each hop of both ways."""
    ways = [way for way in trace.ways if len(way.stamps)]
    heights = [len(way.hops) for way in ways] or [1]
    with canvas(0.8 + 0.21 * sum(heights), rows=len(heights), heights=heights) as (figure, rows):
        for axes, way in zip(rows, ways, strict=False):
            *hops, _whole = hop_costs(way)
            places = np.arange(len(hops))
            axes.barh(
                places, [hop.p99 / MILLISECOND for hop in hops], color=PALE, label="99th percentile"
            )
            axes.barh(
                places,
                [hop.median / MILLISECOND for hop in hops],
                height=0.45,
                color=PREDICTED,
                label="median",
            )
            axes.set_yticks(places, [f"{hop.station}: {hop.name}" for hop in hops])
            axes.invert_yaxis()
            axes.grid(visible=False, axis="y")
            axes.set_title(_TITLES[way.name])
            axes.legend(loc="lower right", ncols=2)
    wholes = [
        f"{whole.median / MILLISECOND:.1f} ms ({whole.p99 / MILLISECOND:.1f} ms) "
        f"{_TITLES[way.name].removesuffix(', ms')}"
        for way in ways
        for whole in hop_costs(way)[-1:]
    ]
    return picture(
        figure,
        "Where a corrected length's time goes",
        f"Median (99th percentile) of {trace.lengths} lengths: "
        f"{'; '.join(wholes) or 'none traced'}. The hops of a length add up to its whole.",
    )
