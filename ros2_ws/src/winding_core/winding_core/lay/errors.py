"""Where a lay is off its wanted line, and whether that is within a tolerance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.lay.records import LayControlRecords, LayRecords
from winding_core.parameters import parameter
from winding_core.units import LENGTH, MILLIMETRE

Array = NDArray[np.float64]

FULL_TURN = 2.0 * math.pi
# Neighbouring places farther apart leave a part between them unmeasured [rad].
_WIDEST_HOLE = 0.5 * math.pi


@dataclass(frozen=True, kw_only=True)
class WantedLine:
    """Where the cable is wanted, as samples of it say."""

    theta: Array  # Wound angles, ascending [rad], shape (n,).
    z: Array  # Wanted axial position there [m], shape (n,).

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
    """One turn of a lay; z are means over the places that were measured in it."""

    number: int  # Of the turn, 1 for the one that begins at P0.
    wanted_z: float  # [m]
    measured_z: float  # [m]
    mean: float  # Of measured less wanted [m].
    rms: float  # Of the same [m].
    largest: float  # Of the same by magnitude, with its sign [m].
    sigma_z: float  # One standard deviation of a measured place [m].
    places: int  # How many there are.
    whole: bool  # Whether they leave no hole of a quarter turn.


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


# In the first turns the guide still gets ahead of the cable.
FIRST_JUDGED = 3
_STARTING_TURNS = "turns 1 and 2, in which the guide gets ahead, are not judged"


@dataclass(frozen=True, kw_only=True)
class LayTolerance:
    """How far from the wanted lay a turn may lie."""

    lay_tolerance: float = parameter(
        0.5e-3,
        "largest distance from the wanted lay that is allowed in every turn after the second",
        LENGTH,
        1.0e-5,
        0.1,
        read_only=False,
    )


@dataclass(frozen=True, kw_only=True)
class LayVerdict:
    """Whether a lay keeps its tolerance."""

    tolerance: float  # [m]
    kept: bool | None  # None where that cannot be judged.
    sentence: str  # What was found.
    # The turn that lies farthest off among those that are judged; None without any.
    worst: TurnError | None = None


def judge(turns: Sequence[TurnError], tolerance: float, wound: float) -> LayVerdict:
    """Return whether every turn after the second lies within a tolerance.

    Args:
        turns: What was measured.
        tolerance: [m]
        wound: Wound angle at the end of the run [rad].
    """
    limit = f"{tolerance / MILLIMETRE:g} mm"
    judged = [turn for turn in turns if turn.number >= FIRST_JUDGED]
    whole = {turn.number for turn in judged if turn.whole}
    last = max([math.floor(wound / FULL_TURN), *(turn.number for turn in judged)])
    missing = [number for number in range(FIRST_JUDGED, last + 1) if number not in whole]
    if not judged:
        return LayVerdict(
            tolerance=tolerance,
            kept=None,
            sentence=f"the lay cannot be held against {limit}: "
            f"{'nothing of it' if missing else 'no turn after the second'} was measured",
        )
    worst = max(judged, key=lambda turn: abs(turn.largest))
    found = f"at most {abs(worst.largest) / MILLIMETRE:.2f} mm off, in turn {worst.number}"
    if abs(worst.largest) > tolerance:
        kept, sentence = False, f"the lay does not keep {limit}: {found}"
    elif missing:
        kept = None
        sentence = (
            f"the lay cannot be held against {limit}: {_numbers(missing)} "
            f"{'was' if len(missing) == 1 else 'were'} not measured all round; else {found}"
        )
    else:
        turns_judged = _numbers(range(FIRST_JUDGED, last + 1))
        kept, sentence = True, f"the lay keeps {limit} in {turns_judged}: {found}"
    return LayVerdict(
        tolerance=tolerance, kept=kept, sentence=f"{sentence}; {_STARTING_TURNS}", worst=worst
    )


def turn_state(turn: TurnError, tolerance: float) -> str:
    """Return in a word or two how a turn lies against a tolerance [m]."""
    if turn.number < FIRST_JUDGED:
        return "not judged"
    if abs(turn.largest) > tolerance:
        return "off"
    return "within" if turn.whole else "partly seen"


def _numbers(turns: Sequence[int]) -> str:
    """Return turns as people name them: turn 3, turns 3 to 6, turns 3, 5 and 6."""
    first, last = turns[0], turns[-1]
    if len(turns) == 1:
        return f"turn {first}"
    if last - first == len(turns) - 1:
        return f"turns {first} {'and' if len(turns) == 2 else 'to'} {last}"
    return f"turns {', '.join(map(str, turns[:-1]))} and {last}"
