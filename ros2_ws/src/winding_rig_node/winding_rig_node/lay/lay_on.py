"""How a cable lies down on a rig with hidden properties while the cylinder turns a little."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_core.compiling import called, compiled
from winding_rig_node.lay.known_lay import neo_hookean_stretch

FloatArray = NDArray[np.float64]
Record = NDArray[np.void]

# What is drawn at random lies evenly between these. Start share and build-up length: the paper's
# rig and one standard error to either side (`winding_study.paper.calibration`, neo_hookean).
FREE_LENGTH = (0.160, 0.230)
LOAD_SHARE = (0.5, 0.9)
DRAG = (0.0, 0.3)
START_SHARE = (0.20, 0.33)
BUILD_UP_LENGTH = (0.13, 0.39)
BRAKE_FRICTION = (0.01, 0.04)

_AT_LEAST_ZERO = ("drag", "guide_play", "brake_friction", "bending", "start_share")


@dataclass(frozen=True, kw_only=True)
class HiddenRig:
    """What of the simulated rig lies between what it measures and where its cable lies."""

    free_length: float  # Tangent span L between the contact line and the eye, across the axis [m]
    load_share: float  # Share of the pull at the guide that reaches the cylinder
    drag: float  # Constant friction of the guide, which pulls too [N]
    start_share: float = 1.0  # Share of the span's tension at P0, f0 of `RigTension`
    build_up_length: float = 0.26  # Wound length over which the tension builds up, L_c [m]
    guide_play: float = 0.0  # Way that the carriage goes back before the eye follows it [m]
    # Share of the pull by which the tension may stay behind a changed pull, to either side.
    brake_friction: float = 0.0
    bending: float = 0.0  # Factor on the section's bending stiffness EI; 0 for a cable without any

    def __post_init__(self) -> None:
        for name in ("free_length", "load_share", "build_up_length"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        for name in _AT_LEAST_ZERO:
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be finite and not negative, got {value}")
        if not self.brake_friction < 1.0:
            raise ValueError(f"brake_friction must be below 1, got {self.brake_friction}")

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> HiddenRig:
        """Draw a plausible rig; guide play and bending are the same in all."""
        return cls(
            free_length=rng.uniform(*FREE_LENGTH),
            load_share=rng.uniform(*LOAD_SHARE),
            drag=rng.uniform(*DRAG),
            start_share=rng.uniform(*START_SHARE),
            build_up_length=rng.uniform(*BUILD_UP_LENGTH),
            guide_play=0.3e-3,
            brake_friction=rng.uniform(*BRAKE_FRICTION),
            bending=1.0,
        )


_stretched = called(neo_hookean_stretch)

GRID_STEP = 0.02  # Angle between points of a path that are kept [rad]
# The bent end of the span is short beside the span; a slack cable would make it endless.
_LONGEST_BENT_END = 0.25


class Contact(NamedTuple):
    """A cable at its contact line."""

    angle: float = 0.0  # Of the cylinder [rad]
    eye: float = 0.0  # Where the eye of the guide stands [m]
    pull: float = math.nan  # On the cable behind the brake's friction [N]; nan before the first
    z: float = 0.0  # Axial position of the lay [m]
    slope: float = 0.0  # Its rise, dz/dTheta [m/rad]
    length: float = 0.0  # Undeformed length since P0 [m]
    tension: float = 0.0  # Of the span [N]
    span_stretch: float = 1.0  # Of the span
    stretch: float = 1.0  # Of what is laid
    next: float = 1.0  # Number of the marker that lands next
    last: float = 0.0  # Wound angle of the last point of the path that was kept [rad]


def contact_at_start() -> Record:
    """Return a cable of which P0 stands at the contact line, fields of `Contact`, shape (1,)."""
    return _record(Contact()._asdict())


def cable_of(case: Case, hidden: HiddenRig) -> Record:
    """Return what does not change while a case is wound on a rig, shape (1,).

    Fields are those of `HiddenRig`, `bending` as EI [N m^2] with its factor, and `rho`, the radius
    of the centre line [m], `axial`, EA [N], and `spacing`, of the markers along the undeformed
    cable [m].
    """
    return _record(
        {
            **asdict(hidden),
            "bending": hidden.bending * case.bending_stiffness,
            "rho": case.centreline_radius,
            "axial": case.axial_area * case.material.young,
            "spacing": case.marker_spacing,
        }
    )


def _record(values: Mapping[str, float]) -> Record:
    """Return values as an array that a kernel can change, shape (1,)."""
    return np.array([tuple(values.values())], dtype=[(name, "<f8") for name in values])


@compiled
def lay_on(
    contacts: Any, cables: Any, markers: FloatArray, angle: float, carriage: float, pull: float
) -> bool:  # pragma: no cover
    """Go on by a small angle forwards, by none, or backwards behind P0.

    Args:
        contacts: The cable at its contact line, see `contact_at_start`; changed.
        cables: What does not change, see `cable_of`.
        markers: Wound angle of each marker [rad], shape (n,); written where one lands.
        angle: Of the cylinder now [rad].
        carriage: Its position now [m].
        pull: On the cable at the guide now [N].

    Returns:
        Whether the lay has gone on by `GRID_STEP` since the last point that was kept.
    """
    contact, cable = contacts[0], cables[0]
    eye_before, start = contact.eye, max(contact.angle, 0.0)
    play = 0.5 * cable.guide_play
    contact.eye = min(max(eye_before, carriage - play), carriage + play)
    held = pull if math.isnan(contact.pull) else contact.pull
    friction = cable.brake_friction
    held = min(max(held, (1.0 - friction) * pull), (1.0 + friction) * pull)
    contact.pull = max(held, 0.0)
    contact.angle = angle
    turned = angle - start
    if turned <= 0.0:
        return False
    _stretch(contact, cable, start + 0.5 * turned)
    before = contact.z
    _follow(contact, cable, turned, eye_before)
    laid = math.hypot(cable.rho * turned, contact.z - before) / contact.stretch
    while contact.next < markers.size:
        left = contact.next * cable.spacing - contact.length
        if left > laid:
            break
        markers[int(contact.next)] = start + turned * left / laid
        contact.next += 1.0
    contact.length += laid
    if angle - contact.last < GRID_STEP:
        return False
    contact.last = angle
    return True


@called
def _stretch(contact: Any, cable: Any, theta: float) -> None:  # pragma: no cover
    """Set tension and stretches of the cable at a wound angle [rad]."""
    wound = cable.rho * theta
    built = 1.0 - (1.0 - cable.start_share) * math.exp(-wound / cable.build_up_length)
    contact.tension = (cable.drag + cable.load_share * contact.pull) * built
    load = contact.tension / cable.axial
    contact.span_stretch = _stretched(load, contact.span_stretch)
    bent = 0.5 * cable.bending * contact.span_stretch / (cable.rho**2 * cable.axial)
    contact.stretch = _stretched(load - bent, contact.stretch)


@called
def _follow(contact: Any, cable: Any, turned: float, eye: float) -> None:  # pragma: no cover
    """Have the contact line follow the eye, which goes evenly from where it stood [m]."""
    advance = (contact.eye - eye) / turned
    bent_end = _LONGEST_BENT_END * cable.free_length
    if contact.tension * bent_end**2 > cable.bending:
        bent_end = math.sqrt(cable.bending / contact.tension)
    slow, quick = (cable.free_length - bent_end) / cable.rho, bent_end / cable.rho
    # Where the lay runs in the end is exact; two differences from it die away.
    lag = advance * (slow + quick)
    off, short, rate = contact.z - eye + lag, 0.0, 0.0
    if quick > 0.0:
        short = -((contact.slope - advance) * slow + off) * quick / (slow - quick)
    off = (off - short) * math.exp(-turned / slow)
    if quick > 0.0:
        short *= math.exp(-turned / quick)
        rate = short / quick
    contact.z = contact.eye - lag + off + short
    contact.slope = advance - off / slow - rate
