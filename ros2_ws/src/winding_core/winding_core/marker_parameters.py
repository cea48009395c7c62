"""What markers look like and where the first one stands, stated once for tracker and commands."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.parameters import parameter
from winding_core.units import ANGLE, HUE, LENGTH


@dataclass(frozen=True, kw_only=True)
class MarkerParameters:
    """Size and colour of the bands, and where P0 is when a run begins."""

    band_width: float = parameter(
        0.006, "width of a marker band along the cable", LENGTH, 0.0005, 0.05, option="band"
    )
    marker_hue: float = parameter(
        50.0, "hue of the markers, 0 red, 60 yellow, 120 green, 240 blue", HUE, 0.0, 360.0
    )
    marker_hue_tolerance: float = parameter(
        22.0, "how far the hue of a marker may lie from that", HUE, 1.0, 90.0
    )
    start_angle: float = parameter(
        0.0,
        "where P0 stands at the first frame, from where the cable lands, in winding direction",
        ANGLE, -3.2, 400.0,
        otherwise="what the encoder says, or else what P0's passes say",
    )  # fmt: skip
