"""Layers of cable on a drum: how far apart they lie, how much cable they take, what it weighs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.lay.program import LayProgram
from winding_core.lay.records import LayRecords
from winding_core.machine.drum import Drum, DrumError
from winding_core.units import MILLIMETRE

Array = NDArray[np.float64]

FULL_TURN = 2.0 * math.pi
# How turns lie upon each other -> widest pitch, in cable diameters. From sqrt(3) diameters on a
# layer would lie on the next but one below; crossing cable falls between wider turns before.
WIDEST_PITCH = {"orthocyclic": 1.7, "parallel": 1.7, "cross": 1.3}
WINDINGS = tuple(WIDEST_PITCH)
# Cable that is seen so much of a diameter off its layer's height lies in none or in another.
HEIGHT_TOLERANCE = 0.3
# On upper layers a place that is so many pitches from where the cable landed is another turn's.
ANOTHER_TURN = 1.5
ROUNDING = 1.0e-9  # A pitch of one diameter may miss it by a rounding


def contact_height(cable_diameter: float, beside: ArrayLike) -> Array:
    """Return by how much cable lies above cable that it touches, so far beside it [m].

    sqrt(d^2 - u^2), nan for cable that does not touch.

    Args:
        cable_diameter: d [m].
        beside: u, distance of the centre lines along the axis [m], any shape.
    """
    room = cable_diameter**2 - np.asarray(beside, dtype=float) ** 2
    return np.sqrt(np.where(room >= 0.0, room, np.nan))


def layer_rise(winding: str, cable_diameter: float, pitch: float) -> float:
    """Return by how much the centre line of a layer lies above that of the layer below [m].

    A turn in the valley between two turns touches both, and rises by sqrt(d^2 - p^2/4). One that
    crosses them lies sqrt(d^2 - u^2) above at a distance u from the nearest, and passes all
    distances up to p/2 evenly: the mean is taken.

    Args:
        winding: One of WINDINGS.
        cable_diameter: d [m].
        pitch: p, between neighbours of a layer [m].

    Raises:
        DrumError: The winding is unknown, or the pitch is closer than the cable is wide or wider
            than the winding holds.
    """
    if winding not in WIDEST_PITCH:
        raise DrumError(f"the winding must be one of {', '.join(WINDINGS)}, got {winding!r}")
    d, p, widest = cable_diameter, pitch, WIDEST_PITCH[winding]
    if not p >= d * (1.0 - ROUNDING):
        raise DrumError(
            f"a pitch of {p / MILLIMETRE:.4g} mm is not the cable's diameter of "
            f"{d / MILLIMETRE:.4g} mm or more: neighbours would overlap"
        )
    if p > widest * d * (1.0 + ROUNDING):
        raise DrumError(
            f"at a pitch of {p / MILLIMETRE:.4g} mm {winding} layers of a cable of "
            f"{d / MILLIMETRE:.4g} mm fall between the turns below: wind them no wider than "
            f"{widest:g} diameters, {widest * d / MILLIMETRE:.4g} mm"
        )
    valley = float(contact_height(d, 0.5 * p))
    if winding == "cross":
        return 0.5 * valley + d**2 / p * math.asin(0.5 * p / d)
    return valley


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One layer, with the change to the next one at its end."""

    number: int  # From 1 on the drum outwards.
    first_turn: float  # Turns behind P0 at which it begins.
    last_turn: float  # At which it ends.
    direction: int  # Of the traverse along z: 1 or -1.
    radius: float  # Of its centre line [m].
    z: Array  # Of its turns where each begins [m], shape (turns begun,).
    last_z: float  # Where its traverse ends [m].
    length: float  # Of the cable in it [m].


@dataclass(frozen=True, kw_only=True)
class WoundDrum:
    """A drum with cable on it, and the path of the cable."""

    drum: Drum  # What is filled.
    cable_diameter: float  # [m]
    winding: str  # One of WINDINGS.
    pitch: float  # Between neighbours of a layer [m].
    layers: tuple[Layer, ...]  # From the drum outwards.
    theta: Array  # Wound angles of the path's points, ascending from 0 at P0 [rad], shape (n,).
    z: Array  # There [m], shape (n,).
    layer: NDArray[np.intp]  # Index of the layer that goes on from there, shape (n,).

    @property
    def turns(self) -> float:
        """Turns from P0 to the end of the cable."""
        return float(self.theta[-1]) / FULL_TURN

    @property
    def radii(self) -> Array:
        """Of the layers' centre lines [m], shape (layers,)."""
        return np.array([layer.radius for layer in self.layers])

    @property
    def lengths(self) -> Array:
        """Of the cable in each layer [m], shape (layers,)."""
        return np.array([layer.length for layer in self.layers])

    @property
    def length(self) -> float:
        """Of all cable on the drum [m]."""
        return float(self.lengths.sum())

    @property
    def filled_diameter(self) -> float:
        """Over the outermost layer [m]."""
        return 2.0 * self.layers[-1].radius + self.cable_diameter

    def in_place(self, places: LayRecords, landed: Array) -> LayRecords:
        """Return the places of a measured lay that were seen as high as their layer lies.

        On cable a place that is far from where the cable landed is one of another turn.

        Args:
            places: LAY_DTYPE, shape (n,).
            landed: Where the cable landed at their wound angles [m], shape (n,).
        """
        raised = self.program().raised_at(places["theta"])
        level = np.abs(places["lift"] - raised) < HEIGHT_TOLERANCE * self.cable_diameter
        near = np.abs(places["z"] - landed) < ANOTHER_TURN * self.pitch
        seen: LayRecords = places[level & ((raised == 0.0) | near)]
        return seen

    def mass(self, per_length: float | Array) -> float:
        """Return the mass of the cable [kg].

        Args:
            per_length: Mass per length of laid cable [kg/m], one or shape (layers,).
        """
        return float(np.sum(per_length * self.lengths))

    def inertia(self, per_length: float | Array) -> float:
        """Return the cable's moment of inertia about the drum's axis [kg m^2].

        Each turn counts as a ring of round section, m (rho^2 + 3/4 r^2).

        Args:
            per_length: Mass per length of laid cable [kg/m], one or shape (layers,).
        """
        square = self.radii**2 + 0.75 * (0.5 * self.cable_diameter) ** 2
        return float(np.sum(per_length * self.lengths * square))

    def program(self, tension: Array | None = None, *, name: str = "drum") -> LayProgram:
        """Return the program that lays the cable.

        Args:
            tension: Pull on each layer [N], shape (layers,); None for the condition's weight.
            name: As reports write it.
        """
        return LayProgram(
            theta=self.theta,
            z=self.z,
            raised=self.radii[self.layer] - self.layers[0].radius,
            tension=np.empty(0) if tension is None else tension[self.layer],
            name=name,
        )
