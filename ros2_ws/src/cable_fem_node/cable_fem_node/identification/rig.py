"""A winding rig as an identification sees it: its numbers, their priors, where a search moves."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.winding.rig_prior import RigPrior
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.units import MEGAPASCAL, MILLIMETRE

# Values by name, shape (n,) each, or (1,) where all rigs have the same.
Numbers = dict[str, FloatArray]
# Beyond so many deviations a number lies at the end of its range.
_FARTHEST = 8.0
_ROUNDING = 1.0e-9
# Laws between which the share of C01 in C10 + C01 goes on: 0 is neo-Hookean.
MOONEY = ("neo_hookean", "mooney_rivlin")


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A number with a prior: normal, or even over a range."""

    name: str  # Of a column of every table of numbers
    words: str = ""  # What it is in tables, with its printed unit
    unit: float = 1.0  # One printed unit in SI
    # Ends of an even prior; two equal ends state that the number is known.
    range: Sequence[float] = (0.0, 0.0)
    even_log: bool = False  # Whether the prior is even, or normal, in the logarithm
    # Median and standard deviation instead of a range; of the logarithm with `even_log`.
    normal: tuple[float, float] | None = None
    asked: bool = True  # Whether it is looked for, or only allowed for

    @property
    def known(self) -> bool:
        """Whether there is nothing to find."""
        if self.normal is not None:
            return self.normal[1] == 0.0
        return self.range[0] == self.range[1]

    def value(self, deviate: FloatArray) -> FloatArray:
        """Return values at standard normal deviates, same shape."""
        from scipy.special import ndtr  # noqa: PLC0415 - a plan without a fit needs none

        low, high = self.range if self.normal is None else self.normal
        if self.normal is not None:
            moved = high * deviate
            return np.asarray(low * np.exp(moved) if self.even_log else low + moved)
        if self.known:
            return np.full(deviate.shape, low)
        place = ndtr(np.clip(deviate, -_FARTHEST, _FARTHEST))
        return np.asarray(
            low * (high / low) ** place if self.even_log else low + (high - low) * place
        )


def unknowns_of(prior: RigPrior, config: WindingConfig) -> tuple[Unknown, ...]:
    """Return all numbers of a rig; the span's tension is (a T + d) [1 - (1 - f) exp(-s / L_c)].

    T is the tension that the run states: measured, or the dead weight's; s is the wound length.
    What is configured is known where the prior has no range of it, else the middle.
    """
    length = config.free_length
    low, high = (factor * length for factor in prior.free_length)
    young = (config.case.material.young, prior.young_deviation)
    friction = prior.friction if prior.friction[1] > 0.0 else [config.friction] * 2
    law = prior.law_share
    if config.law not in MOONEY or law[0] == law[1]:
        ratio = config.mooney_ratio if config.law == "mooney_rivlin" else 0.0
        law = [ratio / (1.0 + ratio)] * 2
    return (
        Unknown(name="young", words="E, MPa", unit=MEGAPASCAL, normal=young, even_log=True),
        Unknown(name="free_length", words="free length, mm", unit=MILLIMETRE, range=(low, high)),
        Unknown(name="load_share", words="load share", range=prior.load_share),
        Unknown(name="guide_drag", words="guide drag, N", range=prior.guide_drag),
        Unknown(
            name="start_share", words="share of the tension at the start", range=prior.start_share
        ),
        Unknown(
            name="build_up_length", words="build-up length, mm", unit=MILLIMETRE,
            range=prior.build_up_length, even_log=True,
        ),
        Unknown(name="friction", words="friction", range=friction, even_log=True),
        Unknown(name="law_share", words="C01 share of the law", range=law),
        Unknown(name="held", range=prior.held, asked=False),
        Unknown(name="brake_friction", range=prior.brake_friction, asked=False),
        Unknown(name="eye", normal=(0.0, prior.eye), asked=False),
        Unknown(name="camera_scale", normal=(0.0, prior.camera_scale), asked=False),
    )  # fmt: skip


def opened(unknowns: Sequence[Unknown]) -> tuple[Unknown, ...]:
    """Return the numbers that are not known, in the order of every vector of deviates."""
    return tuple(item for item in unknowns if not item.known)


def numbers_of(unknowns: Sequence[Unknown], q: FloatArray) -> Numbers:
    """Return all numbers at standard normal deviates of the open ones, shape (n, k)."""
    found = {item.name: item.value(np.zeros(1)) for item in unknowns if item.known}
    pairs = zip(opened(unknowns), q.T, strict=True)
    return found | {item.name: item.value(column) for item, column in pairs}


def with_ratios(found: Numbers) -> Numbers:
    """Return numbers with those over the load share: markers determine ratios alone."""
    return found | {
        "young_per_share": found["young"] / found["load_share"],
        "drag_per_share": found["guide_drag"] / found["load_share"],
    }


@dataclass(frozen=True, kw_only=True)
class RigCoordinates:
    """Where a search moves, and the prior there.

    Markers determine the stretch at which cable was laid, not what made it: modulus, load share
    and drag hide behind each other. So a search moves ln(mean landed stress / E) in the modulus's
    place and the normal deviate of drag over load share in the drag's; the other coordinates are
    the deviates of the open numbers.
    """

    unknowns: tuple[Unknown, ...]  # The modulus first
    pull: float  # Mean stated tension while the markers were wound [N]
    area: float  # That carries it [m^2]
    wound: float  # Length of cable on the cylinder up to the last marker that was used [m]

    @cached_property
    def opened(self) -> tuple[Unknown, ...]:
        """Numbers that are sought, in the order of the coordinates."""
        return opened(self.unknowns)

    def place_of(self, name: str) -> int | None:
        """Return the coordinate of a number; None of one that is known."""
        names = [item.name for item in self.opened]
        return names.index(name) if name in names else None

    @cached_property
    def _drag(self) -> Unknown | None:
        """Drag over load share, within what their ranges allow; None where one is known."""
        share, drag = (self.place_of(name) for name in ("load_share", "guide_drag"))
        if share is None or drag is None:
            return None
        (least, most), (low, high) = self.opened[share].range, self.opened[drag].range
        return Unknown(name="guide_drag", range=(low / most, high / least))

    @cached_property
    def _moved(self) -> tuple[Unknown, ...]:
        ratio = self._drag
        if ratio is None:
            return self.unknowns
        return tuple(ratio if item.name == ratio.name else item for item in self.unknowns)

    def numbers(self, u: FloatArray, steady: NDArray[np.bool_]) -> Numbers:
        """Return numbers.

        Args:
            u: Coordinates, shape (n, k).
            steady: True where the tension does not build up, shape (n,).
        """
        found = numbers_of(self._moved, u)
        if self._drag is not None:
            found["guide_drag"] = found["guide_drag"] * found["load_share"]
        found["start_share"] = np.where(steady, 1.0, found["start_share"])
        found["young"] = self.landed(found) * np.exp(-u[:, 0])
        return found

    def prior(self, u: FloatArray, found: Numbers) -> tuple[FloatArray, FloatArray]:
        """Return residuals, shape (n, k), and what else ln of the prior density has, (n,)."""
        residuals = u.copy()
        assert self.opened[0].normal is not None
        middle, deviation = self.opened[0].normal
        residuals[:, 0] = np.log(found["young"] / middle) / deviation
        if self._drag is None:
            return residuals, np.zeros(u.shape[0])
        low, high = next(item.range for item in self.opened if item.name == "guide_drag")
        drag = found["guide_drag"]
        inside = (low - _ROUNDING <= drag) & (drag <= high + _ROUNDING)
        return residuals, np.where(inside, np.log(found["load_share"]), -np.inf)

    def deviates(self, u: FloatArray, steady: NDArray[np.bool_]) -> FloatArray:
        """Return the deviates of the open numbers by the prior, shape (n, k)."""
        from scipy.special import ndtri  # noqa: PLC0415 - live, beside the machine

        found = self.numbers(u, steady)
        q, _ = self.prior(u, found)
        if self._drag is not None:
            at = self.place_of("guide_drag")
            assert at is not None
            low, high = self.opened[at].range
            place = np.clip((found["guide_drag"] - low) / (high - low), 0.0, 1.0)
            q[:, at] = np.clip(ndtri(place), -_FARTHEST, _FARTHEST)
        return q

    def drawn(self, rng: np.random.Generator, count: int, steady: float) -> Numbers:
        """Return rigs of the prior, whose tension is steady with a probability."""
        found = numbers_of(self.unknowns, rng.standard_normal((count, len(self.opened))))
        found["start_share"] = np.where(rng.random(count) < steady, 1.0, found["start_share"])
        return found

    def landed(self, found: Numbers) -> FloatArray:
        """Return the mean stress that lands [Pa], shape (n,)."""
        full = found["load_share"] * self.pull + found["guide_drag"]
        decay = found["build_up_length"] / self.wound
        grown = 1.0 + (1.0 - found["start_share"]) * decay * np.expm1(-1.0 / decay)
        return np.asarray(full * np.maximum(grown, 1.0e-3) / self.area)

    def with_derived(self, found: Numbers) -> Numbers:
        """Return numbers with E of the cable that the stated tension alone would stretch as much.

        The ratios over the load share come with it.
        """
        effective = found["young"] * self.pull / (self.area * self.landed(found))
        return with_ratios(found) | {"effective_young": effective}

    def start(self, stress: float) -> FloatArray:
        """Return where a search begins, from the mean stress over E that markers show, (k,)."""
        return np.array([math.log(max(stress, 1.0e-4)), *np.zeros(len(self.opened) - 1)])


# Combinations that stand beside the numbers in tables.
DERIVED = (
    Unknown(name="effective_young", words="E under the configured tension, MPa", unit=MEGAPASCAL),
    Unknown(name="young_per_share", words="E over load share, MPa", unit=MEGAPASCAL),
    Unknown(name="drag_per_share", words="drag over load share, N"),
)
