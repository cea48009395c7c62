"""What a run is told of the wanted lay, stated once for the node and the command."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.parameters import parameter
from winding_core.units import LENGTH, PLAIN


@dataclass(frozen=True, kw_only=True)
class LayWish:
    """Where the cable is wanted, and whether the controller drives the machine for it."""

    control: str = parameter(
        "watch",
        "what the controller of the lay begins with: off, watch (says what it would do) or drive",
        PLAIN,
        choices=("off", "watch", "drive"),
    )
    program: str = parameter(
        "", "lay program: a file of CSV, YAML or G-code; empty for an even helix", PLAIN
    )
    pitch: float = parameter(
        0.0,
        "axial advance per turn of the even helix",
        LENGTH,
        -1.0,
        1.0,
        otherwise="the drive programme's",
    )
    markers_every_turn: bool = parameter(
        False, "whether marker n is wanted after n turns; needs a brake", PLAIN
    )
    brake: bool = parameter(False, "whether the machine has a brake that takes commands", PLAIN)
