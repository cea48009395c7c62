"""How long the elements of a winding may be, and what their length costs in stretch."""

from __future__ import annotations

import math

from winding_core.cable.material_law import MaterialLaw

# What suits cylinders of 30 mm and more and moderate stretch [m].
LONGEST = 5.0e-3
# A stretched element of the centreline radius times this leaves the circle so far that the cable
# slips, rides up or never lands: refused.
LARGEST_RATIO = 0.6
# Where the error of the wound stretch was measured.
_MEASURED_AT = 0.465
# Error of the wound tension there, in percent: with a law that does not curve, with one that
# does, and what bending adds once its share of the tension has reached `_BENT` (120 random
# conditions: cylinders of 8 to 300 mm, cables of 0.5 to 12 mm, 0.5 MPa to 36 GPa).
_STRAIGHT_PCT, _CURVED_PCT, _BENDING_PCT, _BENT = 0.5, 1.0, 2.0, 0.15
# Of a stretch, between elements and those of half their length; 0.2 % is the bar.
_ALLOWED_PCT = 0.17


def stretch_error_pct(
    law: MaterialLaw, stretch: float, bending_share: float, ratio: float
) -> float:
    """Return by how much elements of half their length would change the wound stretch [%].

    An element lands as a chord, whose ends move at changing speed; the tension that this makes
    stays where friction holds the cable. The error grows with the square of the ratio.

    Args:
        law: Of the cable.
        stretch: Of the span, a ratio of lengths.
        bending_share: EI l / (2 F rho^2), the share of the tension that bending takes.
        ratio: Length of a stretched element per centreline radius of the wound cable.
    """
    at = _STRAIGHT_PCT if law.law == "linear" else _CURVED_PCT
    tension_pct = at + _BENDING_PCT * min(1.0, bending_share / _BENT)
    return _yielding(law, stretch) * tension_pct * (ratio / _MEASURED_AT) ** 2


def chosen_segment(
    law: MaterialLaw, stretch: float, bending_share: float, radius: float, free_length: float
) -> float:
    """Return the undeformed length of an element [m] that suits a winding.

    Args:
        law: Of the cable.
        stretch: Of the span, a ratio of lengths.
        bending_share: EI l / (2 F rho^2), a share.
        radius: Centreline radius of the wound cable [m].
        free_length: Of the span [m].
    """
    full = stretch_error_pct(law, stretch, bending_share, _MEASURED_AT)
    ratio = _MEASURED_AT * min(1.0, math.sqrt(_ALLOWED_PCT / full)) if full > 0.0 else _MEASURED_AT
    return min(LONGEST, ratio * radius / stretch, 0.1 * free_length)


def _yielding(law: MaterialLaw, stretch: float) -> float:
    """Return d(ln stretch) / d(ln tension)."""
    return float(law.nominal_stress(stretch)) / (stretch * law.tangent(stretch))
