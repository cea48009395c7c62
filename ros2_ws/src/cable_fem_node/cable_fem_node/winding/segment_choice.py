"""How long the elements of a winding may be, and what their length costs in stretch."""

from __future__ import annotations

import math

from winding_core.material_law import MaterialLaw

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
# Error of the wound tension [%] per unit of the ratio and of the sine of the lift-off angle:
# friction holds a stiff cable's element when its middle is still half its length away from where
# it comes to lie. Set by a cable stretched to twice its length (0.35 % between elements of a ratio
# of 0.165 and half of it, sine 0.32); elsewhere it is mostly below the other error.
_LANDING_PCT = 8.5
# Of a stretch, between elements and those of half their length; 0.2 % is the bar.
_ALLOWED_PCT = 0.17
# Of the interval in which the ratio is sought.
_HALVINGS = 40


def stretch_error_pct(
    law: MaterialLaw, stretch: float, bending_share: float, ratio: float
) -> float:
    """Return by how much elements of half their length would change the wound stretch [%].

    An element lands as a chord, whose ends move at changing speed; the tension that this makes
    stays where friction holds the cable: an error that grows with the square of the ratio. That of
    a stiff cable's landing grows with the ratio; the greater one counts.

    Args:
        law: Of the cable.
        stretch: Of the span, a ratio of lengths.
        bending_share: EI l / (2 F rho^2), the share of the tension that bending takes.
        ratio: Length of a stretched element per centreline radius of the wound cable.
    """
    at = _STRAIGHT_PCT if law.law == "linear" else _CURVED_PCT
    chord_pct = at + _BENDING_PCT * min(1.0, bending_share / _BENT)
    tension_pct = max(
        chord_pct * (ratio / _MEASURED_AT) ** 2,
        _LANDING_PCT * _sine_of_lift_off(bending_share) * ratio,
    )
    return _yielding(law, stretch) * tension_pct


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
    low, ratio = 0.0, _MEASURED_AT
    if stretch_error_pct(law, stretch, bending_share, ratio) > _ALLOWED_PCT:
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + ratio)
            if stretch_error_pct(law, stretch, bending_share, middle) > _ALLOWED_PCT:
                ratio = middle
            else:
                low = middle
    return min(LONGEST, ratio * radius / stretch, 0.1 * free_length)


def _sine_of_lift_off(bending_share: float) -> float:
    """Return the sine of arccos(1 - share), at which a stiff cable leaves the cylinder."""
    return math.sqrt(1.0 - (1.0 - min(bending_share, 1.0)) ** 2)


def _yielding(law: MaterialLaw, stretch: float) -> float:
    """Return d(ln stretch) / d(ln tension)."""
    return float(law.nominal_stress(stretch)) / (stretch * law.tangent(stretch))
