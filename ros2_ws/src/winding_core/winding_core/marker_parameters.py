"""What markers look like and where the first one stands, stated once for rig, tracker, commands."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.parameters import ParameterError, parameter
from winding_core.units import ANGLE, HUE, LENGTH, PLAIN

BAND, DOT = "band", "dot"

# Hues of paints by name [deg].
COLOURS = {
    "red": 0.0,
    "orange": 25.0,
    "yellow": 50.0,
    "green": 120.0,
    "cyan": 180.0,
    "blue": 230.0,
    "magenta": 300.0,
}


@dataclass(frozen=True, kw_only=True)
class MarkerLook:
    """What a marker is, how large and of which colour."""

    marker_kind: str = parameter(
        BAND, "what a marker is: a ring around the cable, or a square printed on its outside",
        PLAIN, choices=(BAND, DOT),
    )  # fmt: skip
    band_width: float = parameter(
        0.006, "width of a marker band along the cable", LENGTH, 0.0005, 0.05, option="band"
    )
    dot_size: float = parameter(
        0.003, "side of the square of a marker that is a dot", LENGTH, 0.0005, 0.02, option="dot"
    )
    marker_colours: str = parameter(
        "", "colours of P0, P1 and so on, separated by commas, the last one for all further "
        f"markers: {', '.join(COLOURS)}, or hues in deg; empty where all have one colour",
        PLAIN,
    )  # fmt: skip

    @property
    def hues(self) -> tuple[float, ...]:
        """Hues of P0, P1 and so on [deg]; empty where all markers have one colour.

        Raises:
            ParameterError: A colour that is neither a known name nor a hue, or two colours that
                are too much alike to be told apart.
        """
        words = [word.strip().lower() for word in self.marker_colours.split(",")]
        hues = tuple(_hue(word) for word in words) if self.marker_colours.strip() else ()
        different = sorted(set(hues))
        for one, other in zip(different, different[1:] + different[:1], strict=True):
            if one != other and abs(math.remainder(one - other, 360.0)) < LEAST_APART:
                raise ParameterError(
                    f"parameter marker_colours must have hues {LEAST_APART:g} deg apart, got "
                    f"{one:g} and {other:g}"
                )
        return hues


# Paints that are told apart by their hue alone differ by so much [deg].
LEAST_APART = 20.0


def _hue(word: str) -> float:
    if word in COLOURS:
        return COLOURS[word]
    try:
        hue = float(word)
    except ValueError:
        hue = math.nan
    if not 0.0 <= hue < 360.0:
        raise ParameterError(
            f"parameter marker_colours must list {', '.join(COLOURS)} or hues of 0 to 360 deg, "
            f"got {word[:40]!r}"
        )
    return hue


@dataclass(frozen=True, kw_only=True)
class MarkerParameters(MarkerLook):
    """How markers look, how that is recognised, and where P0 is when a run begins."""

    marker_hue: float = parameter(
        50.0, "hue of the markers, 0 red, 60 yellow, 120 green, 240 blue", HUE, 0.0, 360.0
    )
    marker_hue_tolerance: float = parameter(
        22.0, "how far the hue of a marker may lie from that", HUE, 1.0, 90.0
    )
    dot_torsion: float = parameter(
        0.05,
        "by how much the cable is twisted about itself at a dot, one standard deviation",
        ANGLE, 0.0, 1.5,
    )  # fmt: skip
    start_angle: float = parameter(
        0.0,
        "where P0 stands at the first frame, from where the cable lands, in winding direction",
        ANGLE, -3.2, 400.0,
        otherwise="what the encoder says, or else what P0's passes say",
    )  # fmt: skip
