"""What follows from a winding configuration: law, span state, constants, step, response tables."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cable_fem_node.rod.rod_records import (
    AxialResponse,
    Constants,
    Relaxation,
    axial_response,
    relaxation,
)
from winding_core.cable.cases import Case
from winding_core.cable.material_law import TABLE_HIGH, MaterialLaw

LONGEST = 5.0e-3  # What suits cylinders of 30 mm and more and moderate stretch [m]
# A stretched element of the centreline radius times this leaves the circle so far that the cable
# slips, rides up or never lands: refused.
LARGEST_RATIO = 0.6
_MEASURED_AT = 0.465  # Where the error of the wound stretch was measured
# Error of the wound tension there, in percent: with a law that does not curve, with one that
# does, and what bending adds once its share of the tension has reached `_BENT` (120 random
# conditions: cylinders of 8 to 300 mm, cables of 0.5 to 12 mm, 0.5 MPa to 36 GPa).
_STRAIGHT_PCT, _CURVED_PCT, _BENDING_PCT, _BENT = 0.5, 1.0, 2.0, 0.15
# Of a stretch, between elements and those of half their length; 0.2 % is the bar.
_ALLOWED_PCT = 0.17
# What landing leaves of the tension that bending takes, in percent of the span's, at a bending
# share of 1 and elements as long as the wound radius, and its powers of both: 40 windings with
# shares of 0.05 to 0.85, cables of 3 and 10 % of cylinders of 8 to 300 mm, elements of 0.03 to 0.46
# of the radius, or 0.02 to 1.3 of the bending layer sqrt(EI / F). It may be so much of the wound
# tension; for it elements are not made shorter than this, which would take minutes.
_LANDING = (3.0, 0.5, 0.45)
_ALLOWED_TENSION_PCT, _SHORTEST = 0.9, 0.05
# From this bending share on friction holds a node a landing later, when the cable has bent there
# all the way; it shows a change of tension up to two elements late. The same of 20 such windings.
STIFF, _LATE_LANDING = 0.15, (4.5, 1.0, 1.5)

# Share of the critical step that is taken; the rest covers damping and large rotations.
STEP_SAFETY = 0.8

# Points of the table of stretch and landing radius over tension: errors below 1e-6.
RESPONSE_POINTS = 4001

# Shares of what a segment of the span is lengthened by. Cable that moves over the surface by the
# greater one wakes the resting cable next to it: what rests would have been stretched by that much
# more or less, half of the 0.1 % that its tension shall be known to. Between two looks, a tenth.
STIRRED_SHARE = 5.0e-4
STILL_SHARE = 0.1 * STIRRED_SHARE
# The shares' strain is at least this, so that an unloaded cable has a tolerance.
LEAST_STRAIN = 1.0e-3


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
    tension_pct = _chord_pct(law) + _BENDING_PCT * min(1.0, bending_share / _BENT)
    return _yielding(law, stretch) * tension_pct * (ratio / _MEASURED_AT) ** 2


def tension_error_pct(law: MaterialLaw, bending_share: float, ratio: float) -> float:
    """Return by how much the wound tension may be off F - EI l / (2 rho^2) [%].

    Args:
        law: Of the cable.
        bending_share: EI l / (2 F rho^2), the share of the tension that bending takes, below 1.
        ratio: Length of a stretched element per centreline radius of the wound cable.
    """
    chord = _chord_pct(law) * (ratio / _MEASURED_AT) ** 2 / (1.0 - bending_share)
    landing, power = _landing_pct(bending_share)
    return max(chord, landing * math.pow(ratio, power))


def _landing_pct(bending_share: float) -> tuple[float, float]:
    """Return the error with elements as long as the radius [%], and its power of their length."""
    size, share, power = _LATE_LANDING if bending_share > STIFF else _LANDING
    left = max(1.0 - bending_share, 1.0e-9)
    return size * math.pow(bending_share, share) / left, power


def _chord_pct(law: MaterialLaw) -> float:
    return _STRAIGHT_PCT if law.law == "linear" else _CURVED_PCT


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
    landing, power = _landing_pct(bending_share)
    suits = math.pow(_ALLOWED_TENSION_PCT / landing, 1.0 / power)
    ratio = min(ratio, max(_SHORTEST, suits))
    return min(LONGEST, ratio * radius / stretch, 0.1 * free_length)


def _yielding(law: MaterialLaw, stretch: float) -> float:
    """Return d(ln stretch) / d(ln tension)."""
    return float(law.nominal_stress(stretch)) / (stretch * law.tangent(stretch))


def chord_radius(radius: float, length: float) -> float:
    """Return the radius of nodes whose chords are as long as the arcs of the circle [m]."""
    half = 0.5 * length / radius
    return radius * half / math.sin(half)


@dataclass(frozen=True, kw_only=True)
class ResolvedModel:
    """What follows from a winding configuration."""

    case: Case  # What is wound
    law: MaterialLaw  # Material law in uniaxial tension
    thins: bool  # Whether the wound radius follows the cable's lateral stretch
    tension: float  # Span tension at the start [N]
    lowest_tension: float  # Of the start and of where the tension's build-up ends [N]
    stretch: float  # Of the span at the start
    lateral: float  # Lateral stretch of the span at the start
    wound_radius: float  # Centreline radius of cable wound at that stretch [m]
    segment: float  # Reference length of an element [m]
    # EI l / (2 F rho^2), the share of the span's lowest tension that bending takes
    bending_share: float
    mass_scaling: float  # Factor on the density
    constants: Constants  # Of the rod's kernel
    step: float  # Of the rod [s]: a share of 2 / omega of the stiffest axial and transverse motion
    still: float  # Motion over the surface of a node of the rod that counts as lying still [m]

    @property
    def line_mass(self) -> float:
        """Mass per length of the stretched cable, with its scaling [kg/m]."""
        return self.constants.mass / (self.segment * self.stretch)

    @cached_property
    def axial(self) -> AxialResponse:
        """The law, tabulated for the kernels."""
        return axial_response(self.law, self.case.axial_area)

    @cached_property
    def relaxation(self) -> Relaxation:
        """How the axial stress fades, for the kernels."""
        return relaxation(self.law, self.case.axial_area, self.case.material.prony)

    def elastic_tension(self, stretch: float) -> float:
        """Return what the law carries at once at a stretch [N]."""
        return self.case.axial_area * float(self.law.nominal_stress(stretch))

    @cached_property
    def responses(self) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
        """Tensions [N] up to the law's limit, their stretches and landing radii [m].

        Tabulated, and no arrays, because a measured tension changes a thousand times a second.
        """
        law, k, case = self.law, self.constants, self.case
        highest = min(law.limit()[1], TABLE_HIGH)
        stretch = np.linspace(0.8, highest, RESPONSE_POINTS)
        tension = case.axial_area * law.nominal_stress(stretch)
        lateral = law.lateral_stretch(stretch) if self.thins else np.ones_like(stretch)
        radius = case.cylinder_radius + case.cable_radius * np.maximum(lateral, 0.1)
        length = stretch * k.segment
        wound = np.maximum(tension - 0.5 * k.bending * stretch / radius**2, 0.0)
        half = np.minimum(0.5 * length / radius, 1.5)
        landing = radius * half / np.sin(half) + wound * length / radius / k.touch.normal_stiffness
        return tuple(tension.tolist()), tuple(stretch.tolist()), tuple(landing.tolist())

    def response_at(self, tension: float) -> tuple[float, float]:
        """Return (stretch of the span, radius at which its nodes land [m]) at a tension [N].

        The radius makes up for the chords and for the depth to which the penalty lets the
        wound cable sink.

        Raises:
            ValueError: The tension stretches the cable beyond the tables.
        """
        pulls, stretches, radii = self.responses
        if not pulls[0] <= tension <= pulls[-1]:
            self.stretch_at(tension)
            raise ValueError(f"tension {tension:.4g} N stretches the cable beyond the tables")
        i = max(bisect_left(pulls, tension), 1)
        u = (tension - pulls[i - 1]) / (pulls[i] - pulls[i - 1])
        return (
            stretches[i - 1] + u * (stretches[i] - stretches[i - 1]),
            radii[i - 1] + u * (radii[i] - radii[i - 1]),
        )

    def crept_landing(self, tension: float, faded: float) -> float:
        """Return the radius at which the nodes of a span land that has crept [m].

        Args:
            tension: Of the span [N].
            faded: What more its stretch would carry at once [N].

        Raises:
            ValueError: The cable has crept beyond the tables.
        """
        k = self.constants
        stretch, landing = self.response_at(tension + faded)
        # The table takes the whole force for tension, under which the wound cable sinks in.
        return landing - faded * stretch * k.segment / (k.contact_line * k.touch.normal_stiffness)

    def stretch_at(self, tension: float) -> float:
        """Return the stretch of straight cable under a tension [N]."""
        return self.law.stretch_at(tension / self.case.axial_area)

    def radius_at(self, stretch: float) -> float:
        """Return the centreline radius [m] of cable wound at a stretch."""
        lateral = float(self.law.lateral_stretch(stretch)) if self.thins else 1.0
        return self.case.cylinder_radius + self.case.cable_radius * lateral

    def wound_tension(self, span_tension: float) -> float:
        """Return the tension [N] of the wound cable: F - EI l / (2 rho^2).

        The cable bends at the cost of its own tension where it comes to lie on the cylinder
        (l stretch, rho centreline radius); curvature counts per reference length.
        """
        stretch = self.stretch_at(span_tension)
        radius = self.radius_at(stretch)
        return span_tension - 0.5 * self.case.bending_stiffness * stretch / radius**2

    def wound_stretch(
        self, span_tension: float, landed: Callable[[], Sequence[float]] = tuple
    ) -> float:
        """Return the closed-form mean stretch of the wound cable under a span tension [N].

        Args:
            span_tension: Constant over the run [N].
            landed: Returns when cable landed [s], evenly along it; called for cable that creeps.
        """
        at_once = self.stretch_at(self.wound_tension(span_tension))
        if not self.case.material.prony.shares:
            return at_once
        loads = span_tension * self.case.material.prony.creep(landed())
        crept = [self.stretch_at(self.wound_tension(load)) for load in loads.tolist()]
        return float(np.mean(crept)) if crept else at_once
