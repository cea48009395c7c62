"""What is unknown of a cell before it is commissioned, and how well it is known beforehand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.identification.rig import mean_growth
from cable_fem_node.winding.rig_prior import RigPrior
from cable_fem_node.winding.winding_config import WindingConfig

Array = NDArray[np.float64]

# Beyond so many deviations a normal number lies at the end of its range.
_FARTHEST = 8.0
_ROUNDING = 1.0e-9
# Laws between which the share of C01 in C10 + C01 goes on: 0 is neo-Hookean.
_MOONEY = ("neo_hookean", "mooney_rivlin")


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A number with a prior: normal in its logarithm, or even over a range.

    Attributes:
        name: Of a column of every table of numbers.
        words: What it is in tables.
        unit: One printed unit in SI.
        range: Ends of an even prior; two equal ends state that the number is known.
        even_log: Whether the prior is even in the logarithm.
        normal: Median and standard deviation instead of a range; of the logarithm with `even_log`.
        asked: Whether it is looked for, or only allowed for.
    """

    name: str
    words: str
    unit: float = 1.0
    range: Sequence[float] = (0.0, 0.0)
    even_log: bool = False
    normal: tuple[float, float] | None = None
    asked: bool = True

    @property
    def known(self) -> bool:
        """Whether there is nothing to find."""
        if self.normal is not None:
            return self.normal[1] == 0.0
        return self.range[0] == self.range[1]

    def value(self, deviate: Array) -> Array:
        """Return values at standard normal deviates, same shape."""
        from scipy.special import ndtr  # noqa: PLC0415 - a plan without a fit needs none

        if self.normal is not None:
            middle, deviation = self.normal
            return np.asarray(
                middle * np.exp(deviation * deviate)
                if self.even_log
                else middle + deviation * deviate
            )
        low, high = self.range
        place = ndtr(np.clip(deviate, -_FARTHEST, _FARTHEST))
        if self.even_log:
            return np.asarray(low * (high / low) ** place)
        return np.asarray(low + (high - low) * place)


@dataclass(frozen=True, kw_only=True)
class CellPrior:
    """What data sheet, drawing and construction state before the run.

    Attributes:
        rig: Of modulus, free length, load share, drag and build-up; its `steady` and `held` are
            not used.
        friction: Range of Coulomb friction, even in its logarithm.
        law_share: Range of C01 / (C10 + C01), where the law is neo_hookean or mooney_rivlin.
        brake_friction: Range of the share of the pull by which the tension stays behind a change.
        eye: Standard deviation of the cable's eye against the carriage [m].
        camera_scale: Standard deviation of what the camera's distance does to z, relative.
    """

    rig: RigPrior = field(default_factory=RigPrior)
    friction: tuple[float, float] = (0.06, 2.0)
    law_share: tuple[float, float] = (0.0, 0.6)
    brake_friction: tuple[float, float] = (0.0, 0.05)
    eye: float = 3.0e-4
    camera_scale: float = 1.7e-3

    def unknowns(self, config: WindingConfig) -> tuple[Unknown, ...]:
        """Return all numbers; what is configured is the middle of those that have no range."""
        rig, length = self.rig, config.free_length
        share = self.law_share if config.law in _MOONEY else (0.0, 0.0)
        low, high = (factor * length for factor in rig.free_length)
        young = (config.case.material.young, rig.young_deviation)
        return (
            Unknown(name="young", words="E, MPa", unit=1.0e6, normal=young, even_log=True),
            Unknown(name="law_share", words="C01 share of the law", range=share),
            Unknown(name="friction", words="friction", range=self.friction, even_log=True),
            Unknown(name="free_length", words="free length, mm", unit=1.0e-3, range=(low, high)),
            Unknown(name="load_share", words="load share", range=rig.load_share),
            Unknown(name="guide_drag", words="guide drag, N", range=rig.guide_drag),
            Unknown(
                name="start_share", words="tension's share at the start", range=rig.start_share
            ),
            Unknown(
                name="build_up_length", words="build-up length, mm", unit=1.0e-3,
                range=rig.build_up_length, even_log=True,
            ),
            Unknown(
                name="brake_friction", words="friction of the brake", range=self.brake_friction,
                asked=False,
            ),
            Unknown(name="eye", words="eye, mm", unit=1.0e-3, normal=(0.0, self.eye), asked=False),
            Unknown(
                name="camera_scale", words="scale of z", normal=(0.0, self.camera_scale),
                asked=False,
            ),
        )  # fmt: skip


NAMES = (
    *("young", "law_share", "friction", "free_length", "load_share", "guide_drag"),
    *("start_share", "build_up_length", "brake_friction", "eye", "camera_scale"),
)
COUNT = len(NAMES)
Numbers = dict[str, Array]


_DRAG, _SHARE = NAMES.index("guide_drag"), NAMES.index("load_share")


def numbers_of(unknowns: tuple[Unknown, ...], q: Array) -> Numbers:
    """Return numbers by name, shape (n,) each, of standard normal deviates, shape (n, COUNT)."""
    return {item.name: item.value(column) for item, column in zip(unknowns, q.T, strict=True)}


@dataclass(frozen=True, kw_only=True)
class Coordinates:
    """Where a search moves, and the prior there.

    Markers determine the stretch at which cable was laid, not what made it: modulus, load share
    and drag hide behind each other. So a search moves ln(landed stress / E) in the modulus's place
    and the normal deviate of drag over load share in the drag's; the other coordinates are the
    deviates of the prior.
    """

    unknowns: tuple[Unknown, ...]  # In the order of the coordinates
    pull: float  # Mean pull of the run [N]
    area: float  # That carries it [m^2]
    wound: float  # Length of cable on the cylinder in the end [m]

    def numbers(self, u: Array) -> Numbers:
        """Return numbers by name, shape (n,) each, of coordinates, shape (n, COUNT)."""
        found = numbers_of(self.unknowns, u)
        found["guide_drag"] = self._ratio.value(u[:, _DRAG]) * found["load_share"]
        found["young"] = self._landed(found) * np.exp(-u[:, 0])
        return found

    def prior(self, u: Array, found: Numbers) -> tuple[Array, Array]:
        """Return residuals, shape (n, COUNT), and what else ln of the prior density has, (n,)."""
        middle, deviation = self._young
        residuals = u.copy()
        residuals[:, 0] = np.log(found["young"] / middle) / deviation
        low, high = self.unknowns[_DRAG].range
        inside = (low - _ROUNDING <= found["guide_drag"]) & (
            found["guide_drag"] <= high + _ROUNDING
        )
        return residuals, np.where(inside, np.log(found["load_share"]), -np.inf)

    def deviates(self, u: Array) -> Array:
        """Return the deviates of all numbers by the prior, shape (n, COUNT) each."""
        from scipy.special import ndtri  # noqa: PLC0415 - a plan without a fit needs none

        found = self.numbers(u)
        q, _ = self.prior(u, found)
        low, high = self.unknowns[_DRAG].range
        if high > low:
            place = ndtri(np.clip((found["guide_drag"] - low) / (high - low), 0.0, 1.0))
            q[:, _DRAG] = np.clip(place, -_FARTHEST, _FARTHEST)
        return q

    def start(self) -> Array:
        """Return the coordinates of the middle of the prior, shape (COUNT,)."""
        u = np.zeros((1, COUNT))
        u[0, 0] = math.log(float(self._landed(self.numbers(u))[0]) / self._young[0])
        first: Array = u[0]
        return first

    @property
    def _young(self) -> tuple[float, float]:
        normal = self.unknowns[0].normal
        assert normal is not None
        return normal

    @property
    def _ratio(self) -> Unknown:
        """Drag over load share, within what their ranges allow."""
        (low, high), (least, most) = self.unknowns[_DRAG].range, self.unknowns[_SHARE].range
        return Unknown(name="drag_per_share", words="", range=(low / most, high / least))

    def _landed(self, found: Numbers) -> Array:
        """Return the mean stress that lands [Pa], shape (n,)."""
        full = found["load_share"] * self.pull + found["guide_drag"]
        grown = mean_growth(found["start_share"], found["build_up_length"], self.wound)
        return np.asarray(full * grown / self.area)
