"""One thing that is read at a glance, and numbers as the page writes them."""

import math
from dataclasses import dataclass

from winding_core.units import MILLIMETRE

DASH = "–"
PER_METRE = 1.0 / MILLIMETRE


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A part of the band, a figure, or the outcome of a run."""

    name: str = ""  # What it is, with its unit
    word: str  # In large letters
    remark: str  # Beneath it
    style: str = ""  # CSS class; empty for none


def number(value: float, digits: int, scale: float = 1.0, sign: bool = False) -> str:
    """Return value times a unit's scale with a number of decimals; a dash for nan."""
    if not math.isfinite(value):
        return DASH
    # Minus zero is noise.
    rounded = round(scale * value, digits) + 0.0
    return f"{rounded:+.{digits}f}" if sign else f"{rounded:.{digits}f}"


def millimetres(value: float, digits: int, sign: bool = False) -> str:
    """Return a length [m] in millimetres; a dash for nan."""
    return number(value, digits, PER_METRE, sign)


def seconds(value: float) -> str:
    """Return a time as an operator reads it: seconds, minutes from two of them on."""
    if not math.isfinite(value):
        return DASH
    return f"{value:.0f} s" if value < 120.0 else f"{value / 60.0:.0f} min"
