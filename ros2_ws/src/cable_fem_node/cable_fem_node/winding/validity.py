"""Whether the model can be right about a winding: what is checked before anything is wound."""

import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.winding.resolved_model import (
    LARGEST_RATIO,
    ResolvedModel,
    stretch_error_pct,
    tension_error_pct,
)
from winding_core.helix import FleetAngleLaw
from winding_core.machine.drive import DriveProfile
from winding_core.units import MEGAPASCAL, MILLIMETRE

_NEAR = 0.5  # From this share of a limit on, a condition is worth a warning
# Relative error of the wound stretch that the choice of the element keeps below [%].
_STRETCH_ERROR_PCT = 0.2
_TENSION_ERROR_PCT = 1.0  # Of the wound tension, the promise [%]
# Motion's share of the tension. Six cables (1 to 12 mm on 30 to 300 mm, 2.6 MPa to 110 GPa) with
# their density raised step by step keep their wound tension within 1.5 % up to the first one and
# within 4 % up to the second; at 0.7 a soft one scatters by 15 %, at 2 it has lost half.
_QUASI_STATIC, _FLYING = 0.05, 0.5
# The span's weight over its tension: a span that lies is then tighter at its ends by 0.12 % than
# at its middle, and the other one sags by half its length: it hangs.
_SAGGING, _HANGING, _GRAVITY = 0.1, 4.0, 9.81
# From this modulus on [Pa] materials bear a few percent of strain at most: metals yield below 1 %,
# hard plastics at 2 to 5 % (Ashby, Materials Selection in Mechanical Design, strength and modulus).
_STIFF, _STIFF_STRAIN = 1.0e9, 0.02
# Bent by a plastic moment the neutral line lies F / (4 r sigma_y) from the middle, r the radius.
_QUARTER = 0.25 * math.pi
FULL_TURN = 2.0 * math.pi
OVERLAP = "the cable's width over the least distance of two turns"
# Cable wider than this share of the wound radius and stretched by more is pushed aside by its own
# next turn so steeply that elements of half the length leave its stretch 0.1 to 0.7 % lower (four
# of 2000 random windings are such).
_THICK, _SOFT = 1.0 / 3.0, 1.1
_PARTS = 180  # Parts of a turn at which the lay of a guide that turns back is followed
# Cable that crosses lies 1 / 0.866 times as high as in valleys, and cable may lie on cable.
_CLOSE = 0.85
_ROUNDING = 1.0e-9  # Of a plan that ends where it began [rad]
_MOST_TURNS = 5000  # More turns than this are not followed one by one


@dataclass(frozen=True, kw_only=True)
class Check:
    """One number that decides whether a prediction can be right."""

    name: str  # What it is, with its formula
    value: float  # Of this winding
    warned_from: float  # Above it the result is worth doubting
    refused_from: float  # At it and above nothing is wound; infinite where only a warning is given
    advice: str  # The numbers behind it and the way out, a part of a sentence

    @property
    def refused(self) -> bool:
        """Whether nothing may be wound."""
        return not self.value < self.refused_from

    @property
    def warned(self) -> bool:
        """Whether a result is worth doubting."""
        return self.refused or self.value > self.warned_from

    @property
    def sentence(self) -> str:
        """The check as one sentence."""
        limit = self.refused_from if self.refused else self.warned_from
        return f"{self.name} is {self.value:.3g}, more than {limit:.3g}: {self.advice}"


def checks_of(resolved: ResolvedModel) -> tuple[Check, ...]:
    """Return what can be checked of a model, whatever its element."""
    own = (_stiffness(resolved), _weight(resolved), _fibre(resolved), _span(resolved))
    return (*own, _growth(resolved)) if resolved.case.elastic_core < 1.0 else own


def rod_checks(resolved: ResolvedModel) -> tuple[Check, ...]:
    """Return what can be checked of a model that the rod winds."""
    ratio = resolved.segment * resolved.stretch / resolved.wound_radius
    error = stretch_error_pct(resolved.law, resolved.stretch, resolved.bending_share, ratio)
    segment = f"elements of {resolved.segment / MILLIMETRE:.3g} mm, stretched by"
    radius = f"a wound radius of {resolved.wound_radius / MILLIMETRE:.4g} mm"
    way_out = "shorter elements (segment_length), or leave their length to the solver"
    return (
        *checks_of(resolved),
        Check(
            name="the length of an element over the wound radius",
            value=ratio,
            warned_from=math.inf,
            refused_from=LARGEST_RATIO,
            advice=f"{segment} {resolved.stretch:.4g}, on {radius}; take {way_out}",
        ),
        Check(
            name="the estimated error of the wound stretch [%]",
            value=error,
            warned_from=_STRETCH_ERROR_PCT,
            refused_from=math.inf,
            advice=f"{segment} {resolved.stretch:.4g}, on {radius}; take {way_out}",
        ),
    )


def motion_share(resolved: ResolvedModel, drive: DriveProfile) -> float:
    """Return the share of the tension that motion takes, rho A v max(v, L / t) / F.

    v is the speed of the line, rho A v^2 what bends moving cable round the cylinder, and
    rho A L v / t what brings the span of length L to speed: within the ramp t, or within the time
    of a wave along the span, if that is longer.
    """
    v = drive.angular_speed * resolved.wound_radius
    length = resolved.constants.free_length
    wave = length * math.sqrt(resolved.line_mass * (resolved.stretch - 1.0) / resolved.tension)
    rate = max(v, length / max(drive.ramp_time, wave))
    return resolved.line_mass * v * rate / resolved.lowest_tension


def landing_share(resolved: ResolvedModel, angular_speed: float) -> float:
    """Return what the landing of chords at an angular speed [rad/s] changes the tension by.

    sqrt(rho A v^2 / (F (l - 1))) (h / rho)^2 / 8, a share: the speed of a chord's end changes by
    (h / rho)^2 / 8 of the line's speed v until the next one lands, and the span answers a change
    of speed with sqrt(rho A F / (l - 1)) times as much tension.
    """
    ratio = resolved.segment * resolved.stretch / resolved.wound_radius
    return wave_share(resolved, angular_speed) / (resolved.stretch - 1.0) * ratio**2 / 8.0


def wave_share(resolved: ResolvedModel, angular_speed: float) -> float:
    """Return the line's speed at an angular speed [rad/s] over that of a wave along the span."""
    v = angular_speed * resolved.wound_radius
    return v * math.sqrt(resolved.line_mass * (resolved.stretch - 1.0) / resolved.tension)


def tension_check(resolved: ResolvedModel, drive: DriveProfile) -> Check:
    """Return how far the rod's wound tension may be off, by its landing and its motion."""
    ratio = resolved.segment * resolved.stretch / resolved.wound_radius
    error = tension_error_pct(resolved.law, resolved.bending_share, ratio)
    return Check(
        name="the estimated error of the wound tension [%]",
        value=error + 100.0 * landing_share(resolved, drive.angular_speed),
        warned_from=_TENSION_ERROR_PCT,
        refused_from=math.inf,
        advice=f"bending takes {100.0 * resolved.bending_share:.3g} % of the span's tension, "
        f"elements of {resolved.segment / MILLIMETRE:.3g} mm land on a wound radius of "
        f"{resolved.wound_radius / MILLIMETRE:.4g} mm; take shorter elements (segment_length), "
        "less mass scaling, more tension or a thicker cylinder",
    )


def motion_check(resolved: ResolvedModel, drive: DriveProfile) -> Check:
    """Return whether a model is wound slowly enough."""
    return Check(
        name="the share of the tension that motion takes, rho A v max(v, L / t) / F,",
        value=motion_share(resolved, drive),
        warned_from=_QUASI_STATIC,
        refused_from=_FLYING,
        advice=f"{drive.angular_speed:.4g} rad/s after {drive.ramp_time:.3g} s, tension "
        f"{resolved.lowest_tension:.4g} N, mass scaling {resolved.mass_scaling:g}; take less mass "
        "scaling, a slower cylinder, a longer ramp or more tension",
    )


def refuse(checks: tuple[Check, ...]) -> None:
    """Refuse what cannot be right.

    Raises:
        ValueError: The first check that refuses, as its sentence.
    """
    for check in checks:
        if check.refused:
            raise ValueError(check.sentence)


def _stiffness(resolved: ResolvedModel) -> Check:
    case = resolved.case
    return Check(
        name="the bending stiffness against the tension, EI l / (2 F rho^2),",
        value=resolved.bending_share,
        warned_from=_NEAR,
        refused_from=1.0,
        advice=f"EI {case.bending_stiffness:.3g} N m^2 (E {case.material.young / MEGAPASCAL:.4g} "
        f"MPa, cable {case.cable_diameter / MILLIMETRE:.4g} mm), lowest tension "
        f"{resolved.lowest_tension:.4g} N, "
        f"wound radius {resolved.wound_radius / MILLIMETRE:.4g} mm; such a cable does not lie on "
        "the cylinder: take more tension, a thicker cylinder or a softer cable, or state what it "
        "bends like if it is no full elastic bar: wires that slip (bending_factor), a stress at "
        "which it yields (yield_stress)",
    )


def _weight(resolved: ResolvedModel) -> Check:
    length, pull = resolved.constants.free_length, max(resolved.lowest_tension, 1.0e-300)
    share = resolved.line_mass / resolved.mass_scaling * _GRAVITY * length / pull
    return Check(
        name="the weight of the span over its tension, w L / F,",
        value=share,
        warned_from=_SAGGING,
        refused_from=_HANGING,
        advice=f"the span of {length:.4g} m is computed straight; lying, it sags by "
        f"w L^2 / (8 F), {share * length / 8.0 / MILLIMETRE:.3g} mm, and is tighter by "
        f"{100.0 * share**2 / 8.0:.3g} % at its ends, upright by {100.0 * share:.3g} % at its "
        "upper end: take more tension or a shorter span",
    )


def _fibre(resolved: ResolvedModel) -> Check:
    case = resolved.case
    strain = case.cable_radius / resolved.wound_radius
    own = case.material.bending_limit
    # Wires that slip are as thick as the whole times the root of the factor.
    wire = math.sqrt(min(case.material.bending_factor, 1.0))
    guess = _STIFF_STRAIN / wire if case.material.young >= _STIFF else math.inf
    return Check(
        name="the bending strain of the outer fibre, d / (D + d),",
        value=strain,
        warned_from=own or guess,
        refused_from=own or math.inf,
        advice=f"cable {case.cable_diameter / MILLIMETRE:.4g} mm on a cylinder of "
        f"{case.cylinder_diameter / MILLIMETRE:.4g} mm, limit "
        + ("of the material (bending_limit)" if own else "of stiff materials, as none is given")
        + "; beyond it the cable yields, breaks or kinks: take a thicker cylinder or a thinner "
        "cable, or state what the material bears (bending_limit)",
    )


def _growth(resolved: ResolvedModel) -> Check:
    case = resolved.case
    share = resolved.tension / (case.section_area * case.material.yield_stress)
    grown = 100.0 * _QUARTER * share * case.cable_radius / resolved.wound_radius
    return Check(
        name="the stretch that yielding leaves, (pi / 4) F / (A sigma_y) d / (D + d) [%],",
        value=grown,
        warned_from=_STRETCH_ERROR_PCT,
        refused_from=math.inf,
        advice=f"under {resolved.tension:.4g} N the middle of the wire yields with its outer side "
        f"as it is bent, and it comes to lie longer by {grown:.2g} %, which is not computed: take "
        "less tension or a thicker cylinder, or multiply wound lengths by "
        f"{1.0 + 0.01 * grown:.4f}",
    )


def _span(resolved: ResolvedModel) -> Check:
    length, free = resolved.segment, resolved.constants.free_length
    return Check(
        name="the segment_length over the free length",
        value=length / free,
        warned_from=0.3,
        # As long as that is still wound.
        refused_from=math.nextafter(0.3, 1.0),
        advice=f"segment_length must be at most 0.3 of the free length {free:g} m, "
        f"got {length:g} m",
    )


def overlap_check(
    resolved: ResolvedModel, drive: DriveProfile, duration: float, *, solid: bool
) -> Check:
    """Return whether turns lie beside each other, by the fleet-angle law.

    The span of length L pulls the cable after the guide: with tau = L / rho the first turn
    advances by p (2 pi - tau (1 - exp(-2 pi / tau))) / (2 pi) of the pitch p.

    Args:
        resolved: What is wound.
        drive: How the machine moves; by more than a turn.
        duration: For how long [s].
        solid: Whether turns pass through each other. Then they must lie apart, but for the first
            ones, which lie closer on the paper's stiffest cable as well.

    Raises:
        ValueError: The guide turns back, over more turns than are followed.
    """
    width = resolved.constants.touch.apart
    length, radius = resolved.constants.free_length, resolved.wound_radius
    angle, guide = (np.asarray(v) for v in drive.positions(np.linspace(0.0, duration, 2001)))
    turns = angle.max() / FULL_TURN
    always = False
    if np.ptp(np.sign(np.diff(guide))) < 2.0:
        always = abs(drive.pitch) < width
        law = FleetAngleLaw(
            advance_per_radian=abs(drive.pitch) / FULL_TURN, free_length=length, radius=radius
        )
        advances = np.diff(law.z(FULL_TURN * np.arange(int(turns) + 1)))
        least, over = float(advances[0]), int(np.count_nonzero(advances < width))
        where = (
            f"turns 1 to {over} of {int(turns)} come to lie on the turn before, the first by "
            f"{(width - least) / MILLIMETRE:.3g} mm of {width / MILLIMETRE:.3g} mm, because the "
            f"guide advances {abs(drive.pitch) / MILLIMETRE:.3g} mm per turn and the cable lags "
            f"behind it by up to {math.degrees(law.lag_angle):.3g} degrees"
        )
    else:
        if turns > _MOST_TURNS:
            raise ValueError(
                f"a guide that turns back is followed for {_MOST_TURNS} turns at most, "
                f"got {turns:.4g}"
            )
        fine = np.linspace(0.0, duration, max(2, math.ceil(_PARTS * duration * _turn_rate(drive))))
        angle, guide = (np.asarray(values) for values in drive.positions(fine))
        after, place, least = crossing(angle, guide, length / radius, width)
        always = math.isfinite(least)
        where = (
            f"the guide turns back: after {after:.3g} turns the cable comes to lie at "
            f"{place / MILLIMETRE:.4g} mm, {least / MILLIMETRE:.3g} mm from a turn laid before"
        )
    steep = width > _THICK * radius and resolved.stretch > _SOFT
    becomes = "turns of the solid pass through each other" if solid else "it is computed as such"
    if steep:
        becomes = (
            f"cable wider than a third of the wound radius of {radius / MILLIMETRE:.4g} mm, "
            f"stretched by {resolved.stretch:.3g}, is pushed aside too steeply to be computed"
        )
    return Check(
        name=OVERLAP,
        value=width / max(least, 1.0e-300),
        warned_from=1.0,
        refused_from=math.nextafter(1.0, 2.0) if steep or (solid and always) else math.inf,
        advice=f"{where}; {becomes}: take more feed, a shorter span or a thicker cylinder",
    )


def guide_check(resolved: ResolvedModel, angle: float) -> Check:
    """Return whether the guide stands clear of layers between flanges, see `ContactLaw`.

    Layers lie as low as they can, one in the valleys of the other, sqrt(3) / 2 diameters above it.
    """
    touch = resolved.constants.touch
    turns = (touch.high - touch.low) / touch.apart + 1.0
    layers = max(1, math.ceil(angle / FULL_TURN / turns))
    top = resolved.wound_radius + (math.sqrt(0.75) * (layers - 1) + 0.5) * touch.apart
    guide = math.hypot(resolved.wound_radius, resolved.constants.free_length)
    return Check(
        name="the radius of the highest layer over the guide's distance from the axis",
        value=top / guide,
        warned_from=_CLOSE,
        refused_from=1.0,
        advice=f"{layers} layers of {turns:.3g} turns lie at least {top / MILLIMETRE:.4g} mm from "
        f"the axis, from which the guide stands {guide / MILLIMETRE:.4g} mm away; take a longer "
        "span (free_length), fewer layers or a wider drum",
    )


def refuse_past_the_start(angle: FloatArray) -> None:
    """Refuse a cylinder that unwinds more than was wound; its angle [rad] over time, shape (n,).

    Raises:
        ValueError: The sentence contains how far it would turn back.
    """
    least = float(angle.min())
    if least < -_ROUNDING:
        raise ValueError(
            f"the cylinder would turn back to {least:.4g} rad, past the start, where nothing "
            "is wound any more: unwind for a shorter time"
        )


def crossing(
    angle: FloatArray, guide: FloatArray, lag: float, width: float
) -> tuple[float, float, float]:
    """Return where a lay first comes closer than a width to a turn laid before.

    Neighbours of a guide that goes on as it began may touch; from where it has turned back, or
    falls below a width per turn, the lay counts.

    Args:
        angle: Of the cylinder over time [rad], shape (n,), from 0 on, not below 0.
        guide: Position of the guide [m], shape (n,).
        lag: Rotation in which the cable follows the guide, L / rho [rad].
        width: Of the cable [m].

    Returns:
        After how many turns, at which z [m], how near [m]; infinite where it never does.
    """
    part = FULL_TURN / _PARTS
    lay = [0.0]
    place = np.concatenate([[0.0], np.zeros(int(angle.max() / part) + 1)])
    guided = np.zeros_like(place)
    steady = True
    for i in range(1, angle.size):
        last = int(angle[i] / part)
        del lay[last + 1 :]
        while len(lay) <= last:
            k = len(lay)
            share = (k * part - angle[i - 1]) / max(angle[i] - angle[i - 1], 1.0e-300)
            at = guide[i - 1] + min(max(share, 0.0), 1.0) * (guide[i] - guide[i - 1])
            lay.append(lay[-1] + (at - lay[-1]) * -math.expm1(-part / lag))
            place[k], guided[k] = lay[-1], at
            if k < _PARTS:
                continue
            steady = steady and abs(at - guided[k - _PARTS]) >= width
            if steady:
                continue
            apart = np.abs(place[k % _PARTS : k : _PARTS] - place[k])
            if apart.min() < width:
                return k * part / FULL_TURN, place[k], float(apart.min())
    return math.inf, math.inf, math.inf


def _turn_rate(drive: DriveProfile) -> float:
    return abs(drive.angular_speed) / FULL_TURN
