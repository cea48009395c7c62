"""Numbers as the page writes them."""

from __future__ import annotations

import math

from winding_core.units import MILLIMETRE

DASH = "–"
PER_METRE = 1.0 / MILLIMETRE


def number(value: float, digits: int, scale: float = 1.0, sign: bool = False) -> str:
    """Return value times a unit's scale with a number of decimals; a dash for nan."""
    if not math.isfinite(value):
        return DASH
    # Minus zero is noise.
    rounded = round(scale * value, digits) + 0.0
    return f"{rounded:+.{digits}f}" if sign else f"{rounded:.{digits}f}"


def seconds(value: float) -> str:
    """Return a time as an operator reads it: seconds, minutes from two of them on."""
    if not math.isfinite(value):
        return DASH
    return f"{value:.0f} s" if value < 120.0 else f"{value / 60.0:.0f} min"
