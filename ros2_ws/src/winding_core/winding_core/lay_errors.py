"""How far a measured lay is from the wanted one, over the wound angle and turn by turn."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.lay_control_records import LayControlRecords
from winding_core.lay_records import LayRecords

Array = NDArray[np.float64]

FULL_TURN = 2.0 * math.pi
# Neighbouring places farther apart leave something between them that nobody measured [rad].
_WIDEST_HOLE = 0.5 * math.pi


@dataclass(frozen=True, kw_only=True)
class WantedLine:
    """Where the cable is wanted, as samples of it say.

    Attributes:
        theta: Wound angles, ascending [rad], shape (n,).
        z: Wanted axial position there [m], shape (n,).
    """

    theta: Array
    z: Array

    @classmethod
    def of(cls, theta: ArrayLike, z: ArrayLike) -> WantedLine:
        """Return the line through samples in any order [rad], [m], shape (n,)."""
        angles, heights = np.asarray(theta, dtype=float), np.asarray(z, dtype=float)
        known = np.isfinite(angles) & np.isfinite(heights)
        angles, first = np.unique(angles[known], return_index=True)
        return cls(theta=angles, z=heights[known][first])

    @classmethod
    def recorded(cls, records: LayControlRecords) -> WantedLine:
        """Return what a controller of the lay followed, from its records."""
        return cls.of(records["theta"], records["wanted_z"])

    def at(self, theta: ArrayLike) -> Array:
        """Return the wanted z [m] at wound angles [rad], same shape; nan beyond the samples."""
        theta = np.asarray(theta, dtype=float)
        if not self.theta.size:
            return np.full(theta.shape, np.nan)
        return np.asarray(np.interp(theta, self.theta, self.z, left=np.nan, right=np.nan))

    @property
    def end(self) -> float:
        """Largest wound angle that is known [rad]; 0 where none is."""
        return float(self.theta[-1]) if self.theta.size else 0.0


@dataclass(frozen=True, kw_only=True)
class TurnError:
    """One turn of a lay; z are means over the places that were measured in it.

    Attributes:
        number: Of the turn, 1 for the one that begins at P0.
        wanted_z: [m]
        measured_z: [m]
        mean: Of measured less wanted [m].
        rms: Of the same [m].
        largest: Of the same by magnitude, with its sign [m].
        sigma_z: One standard deviation of a measured place [m].
        places: How many there are.
        whole: Whether they leave no hole of a quarter turn.
    """

    number: int
    wanted_z: float
    measured_z: float
    mean: float
    rms: float
    largest: float
    sigma_z: float
    places: int
    whole: bool


def lay_errors(places: LayRecords, wanted: WantedLine) -> Array:
    """Return measured less wanted z [m] of every place, shape (n,); nan where none is wanted."""
    return np.asarray(places["z"].astype(float) - wanted.at(places["theta"]))


def turn_errors(places: LayRecords, wanted: WantedLine) -> tuple[TurnError, ...]:
    """Return the error of every turn in which something was measured, in order."""
    errors = lay_errors(places, wanted)
    known = np.isfinite(errors)
    order = np.argsort(places["theta"][known])
    places, errors = places[known][order], errors[known][order]
    turns = np.floor(places["theta"] / FULL_TURN).astype(int)
    return tuple(
        _turn(int(turn), places[turns == turn], errors[turns == turn], wanted.end)
        for turn in np.unique(turns)
    )


def _turn(turn: int, places: LayRecords, errors: Array, wound: float) -> TurnError:
    begin, end = FULL_TURN * turn, FULL_TURN * (turn + 1)
    # What has not been wound is no hole.
    ends = [end] if wound >= end else []
    holes = np.diff(np.concatenate([[begin], places["theta"], ends]))
    measured = places["z"].astype(float)
    return TurnError(
        number=turn + 1,
        wanted_z=float(np.mean(measured - errors)),
        measured_z=float(np.mean(measured)),
        mean=float(np.mean(errors)),
        rms=float(np.sqrt(np.mean(errors**2))),
        largest=float(errors[np.argmax(np.abs(errors))]),
        sigma_z=float(np.mean(places["sigma_z"])),
        places=int(errors.size),
        whole=bool(holes.max() < _WIDEST_HOLE),
    )
