"""What is wrong with the layers on a drum: gaps, climbs and turns that are missing at an edge."""

import math
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.layers import ANOTHER_TURN, FULL_TURN, Layer, WoundDrum
from winding_core.units import MILLIMETRE

Array = NDArray[np.float64]

_PER_TURN = 72  # Places that are compared with those of the turn before
# Neighbours that are so many diameters farther apart or closer than wanted lie wrong, and so do
# those whose places are known no better than so many deviations.
_OFF, _DEVIATIONS = 0.3, 4.0
_TOUCHES = 2.0  # Cable that lies beside the turn before within so many deviations touches it
_SAME = 0.5  # Two turns of a layer lie farther apart than so many diameters
# Cable that is seen so many diameters higher than planned has climbed; what is seen nearer than
# this to the turn before may be that turn.
_HIGH, _OTHER = 0.5, 0.1
# For so many places in a row, a sixth of a turn: what is pushed aside while it climbs is shorter.
_IN_A_ROW = 12
# What lands now is seen a little later: measured is what was seen of it by half.
_MOSTLY = 0.5
_BEFORE_END = 2
# An edge turn lies within so many pitches of the place that is planned for it.
_AT_EDGE, _NEAR_EDGE = 0.5, 0.1


class Fault(StrEnum):
    """What can be wrong with a turn."""

    GAP = "gap"
    CLIMB = "climb"
    EDGE = "missing edge turn"


@dataclass(frozen=True, kw_only=True)
class LayerFault:
    """Something wrong with a turn, and how that is known."""

    kind: Fault  # What is wrong
    layer: int  # From 1 on the drum
    turn: int  # Turns behind P0, from 1
    theta: float  # Wound angle where it was found [rad]
    off: float  # Distance from the neighbour, or from the place at the edge [m]
    measured: bool  # Whether the camera saw it; else it follows from where the guide was

    @property
    def sentence(self) -> str:
        """The fault as people read it."""
        of = "from its place at the flange" if self.kind is Fault.EDGE else "from the turn before"
        how = "measured" if self.measured else "by the guide's way, not measured"
        return (
            f"{self.kind} in layer {self.layer}, turn {self.turn}: "
            f"{self.off / MILLIMETRE:.1f} mm {of}, {how}"
        )

    def record(self) -> dict[str, Any]:
        """Return the fault as plain values."""
        return asdict(self)


class LayerWatch:
    """Compares each turn with the one before, and the ends of layers with their flanges.

    It knows where the cable landed: as estimated while it lands, and as measured where it was seen
    as high as its layer lies. Only neighbours of one layer are compared.
    """

    def __init__(self, wound: WoundDrum) -> None:
        self._wound = wound
        count = math.ceil(wound.turns + 1.0) * _PER_TURN
        self._z, self._sigma = np.full(count, np.nan), np.full(count, np.inf)
        self._measured, self._high = np.zeros((2, count), dtype=bool)
        self._layers = np.zeros(count, dtype=np.intp)
        for layer in wound.layers:
            self._layers[self._place(layer.first_turn * FULL_TURN) :] = layer.number
        theta = (np.arange(count) + 0.5) * FULL_TURN / _PER_TURN
        self._wanted = wanted = np.interp(theta, wound.theta, wound.z)
        self._onward = np.array([layer.direction for layer in wound.layers])[self._layers - 1]
        self._apart = self._onward * (wanted - np.roll(wanted, _PER_TURN))
        self._landed = self._next_edge = 0
        self.faults: list[LayerFault] = []  # What was found, in order

    def layer_at(self, theta: float) -> Layer:
        """Return the layer that is planned at a wound angle [rad]."""
        return self._wound.layers[int(self._layers[self._place(theta)]) - 1]

    @property
    def layer_turns(self) -> list[float]:
        """Turns behind P0 at which each layer begins, and the last one ends."""
        layers = self._wound.layers
        return [*(layer.first_turn for layer in layers), layers[-1].last_turn]

    def measured_share(self, layer: int) -> float:
        """Return the share of a layer's landed places that was measured; nan before any."""
        landed = (self._layers == layer) & np.isfinite(self._z)
        return float(self._measured[landed].mean()) if landed.any() else math.nan

    def land(self, theta: float, z: float, sigma: float) -> None:
        """Take where the cable lands now: wound angle [rad], z and its deviation [m]."""
        at = self._place(theta)
        if theta < 0.0 or not math.isnan(self._z[at]):
            return
        since = slice(self._landed, at + 1)
        start = self._z[self._landed]
        self._z[since] = np.linspace(z if math.isnan(start) else start, z, at + 1 - self._landed)
        self._sigma[since] = sigma
        self._landed = at
        self._judge(at)

    def measure(self, theta: float, z: float, sigma: float) -> None:
        """Take where the cable was seen: wound angle [rad], z and its deviation [m]."""
        at = self._place(theta)
        if theta < 0.0 or math.isnan(self._z[at]):
            return
        near = abs(z - self._z[at]) < ANOTHER_TURN * self._wound.pitch
        if near or self._layers[at] == 1:
            self._z[at], self._sigma[at], self._measured[at] = z, sigma, True
            self._judge(at)

    def see_height(self, theta: float, z: float, lift: float) -> None:
        """Take how high cable was seen, whether it counts as measured or not.

        Cable that lies in a layer above the planned one has climbed. It may do so at a flange, a
        sixth of a turn before its layer is full.

        Args:
            theta: Wound angle [rad].
            z: Where the cable was seen [m].
            lift: Height above that on the bare cylinder [m].
        """
        at, diameter = self._place(theta), self._wound.cable_diameter
        soon = self._layers[min(at + _IN_A_ROW, self._layers.size - 1)]
        planned = self._wound.radii[soon - 1] - self._wound.radii[0]
        beside = self._beside(at, z)
        self._high[at] = lift > planned + _HIGH * diameter and abs(beside) > _OTHER * diameter
        if at >= _IN_A_ROW and self._high[at - _IN_A_ROW + 1 : at + 1].all():
            self._find(Fault.CLIMB, at, beside, measured=True)

    def held(self, theta: float, z: float, sigma: float) -> float:
        """Return in which sense of z, 1 or -1, the turn before may hold cable that was seen.

        Args:
            theta: Wound angle [rad].
            z: Where the cable was seen [m].
            sigma: One standard deviation of z [m].

        Returns:
            0 where it does not touch that turn.
        """
        at = self._place(theta)
        if not self._measured[at - _PER_TURN]:
            return 0.0
        apart = self._beside(at, z) - self._wound.cable_diameter
        touches = apart < _TOUCHES * math.hypot(sigma, self._sigma[at - _PER_TURN])
        return float(self._onward[at]) if touches else 0.0

    def is_turn_before(self, theta: float, z: float) -> bool:
        """Return whether a place [rad, m] is one of the turn before, where no other cable lies."""
        return self._beside(self._place(theta), z) < _SAME * self._wound.cable_diameter

    def _beside(self, at: int, z: float) -> float:
        """Return how far a place lies onward of the turn before [m]; nan without one."""
        before = at - _PER_TURN
        if before < 0 or self._layers[at] != self._layers[before]:
            return math.nan
        return float(self._onward[at] * (z - self._z[before]))

    def _place(self, theta: float) -> int:
        return min(max(int(theta / FULL_TURN * _PER_TURN), 0), self._z.size - 1)

    def _judge(self, at: int) -> None:
        first = at - _IN_A_ROW + 1
        before = slice(first - _PER_TURN, at + 1 - _PER_TURN)
        places = slice(first, at + 1)
        if first >= _PER_TURN and self._layers[at] == self._layers[first - _PER_TURN]:
            apart = self._onward[at] * (self._z[places] - self._z[before])
            diameter, wanted = self._wound.cable_diameter, self._apart[places]
            doubt = _DEVIATIONS * np.hypot(self._sigma[places], self._sigma[before])
            beyond = np.maximum(_OFF * diameter, doubt)
            known = bool(self._measured[places].mean() >= _MOSTLY)
            if (apart > wanted + beyond).all():
                self._find(Fault.GAP, at, float(np.median(apart)), measured=known)
            elif (apart < np.minimum(wanted, diameter) - beyond).all():
                self._find(Fault.CLIMB, at, float(np.median(apart)), measured=known)
        self._judge_edge(at)

    def _judge_edge(self, at: int) -> None:
        """Hold the last turn of a layer against the place that is planned for it."""
        if self._next_edge == len(self._wound.layers):
            return
        layer = self._wound.layers[self._next_edge]
        # The run ends with the last layer, a place or two before it may be.
        end = self._place(layer.last_turn * FULL_TURN) - _BEFORE_END
        if at < end:
            return
        self._next_edge += 1
        turn = np.arange(max(end - _PER_TURN, 0), end)
        away = np.abs(self._wanted[turn] - layer.last_z)
        edge = turn[away <= away.min() + _NEAR_EDGE * self._wound.pitch]
        off = float(np.median(layer.direction * (self._wanted[edge] - self._z[edge])))
        doubt = _DEVIATIONS * float(np.median(self._sigma[edge]))
        if off > max(_AT_EDGE * self._wound.pitch, doubt):
            known = bool(self._measured[edge].mean() >= _MOSTLY)
            self._find(Fault.EDGE, end - 1, off, measured=known)

    def _find(self, kind: Fault, at: int, off: float, *, measured: bool) -> None:
        theta = (at + 0.5) / _PER_TURN * FULL_TURN
        turn = at // _PER_TURN + 1
        for k in range(len(self.faults) - 1, -1, -1):
            known = self.faults[k]
            if known.kind is kind and theta - known.theta < FULL_TURN:
                self.faults[k] = replace(known, measured=known.measured or measured)
                return
        self.faults.append(
            LayerFault(
                kind=kind,
                layer=int(self._layers[at]),
                turn=turn,
                theta=theta,
                off=off,
                measured=measured,
            )
        )
