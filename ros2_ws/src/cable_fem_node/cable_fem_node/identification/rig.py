"""A winding rig as an identification sees it: what pulls and guides the cable."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.winding.rig_prior import RigPrior

# What an estimate has, in the order of every vector and matrix.
NAMES = ("young", "free_length", "load_share", "guide_drag", "start_share", "build_up_length")
# ln of the mean landed stress over E; then free length, load share, drag, start share and where
# friction holds, each as the normal deviate of its place in its range.
COUNT = 6
_FARTHEST = 8.0


@dataclass(frozen=True, kw_only=True)
class Rigs:
    """Many rigs at once; the span's tension is (a T + d) [1 - (1 - f) exp(-s / L_c)].

    T is the tension that the run states: measured, or the dead weight's; s is the wound length.
    """

    young: FloatArray  # E of the cable [Pa], shape (n,)
    free_length: FloatArray  # Tangent span between contact line and guide [m], shape (n,)
    load_share: FloatArray  # a, share of the stated tension that reaches the cylinder, shape (n,)
    guide_drag: FloatArray  # d [N], shape (n,)
    start_share: FloatArray  # f, share of the tension at the start, shape (n,)
    build_up_length: FloatArray  # L_c [m] of wound cable, shape (n,)
    # Way from the landing point to where friction holds, over that of the rod, shape (n,) or (1,)
    held: FloatArray = field(default_factory=lambda: np.ones(1))

    def table(self) -> FloatArray:
        """Return all numbers in the order of NAMES, shape (n, 6)."""
        return np.column_stack([getattr(self, name) for name in NAMES])

    def part(self, rows: NDArray[np.intp]) -> Rigs:
        """Return some of the rigs."""
        return Rigs(
            **{name: getattr(self, name)[rows] for name in NAMES},
            held=np.broadcast_to(self.held, self.young.shape)[rows],
        )


@dataclass(frozen=True, kw_only=True)
class RigCoordinates:
    """From coordinates (n, 6), build-up lengths and whether the tension is steady to rigs.

    Markers determine the stretch at which the cable was laid, not what made it: E, load share and
    drag hide behind each other. So the first coordinate is that stretch, and E follows.
    """

    prior: RigPrior  # What was known
    young: float  # E as configured [Pa]
    free_length: float  # As configured [m]
    pull: float  # Mean stated tension while the markers were wound [N]
    area: float  # That carries it [m^2]
    wound: float  # Length of cable on the cylinder up to the last marker that was used [m]

    def rigs(self, q: FloatArray, build_up: FloatArray, steady: NDArray[np.bool_]) -> Rigs:
        """Return the rigs.

        Args:
            q: Shape (n, 6).
            build_up: L_c [m], shape (n,).
            steady: True where the tension does not build up, shape (n,).
        """
        from scipy.special import ndtr  # noqa: PLC0415 - live, beside the machine

        place = ndtr(np.clip(q[:, 1:], -_FARTHEST, _FARTHEST))
        prior = self.prior

        def within(limits: Sequence[float], column: int) -> FloatArray:
            low, high = limits
            return np.asarray(low + (high - low) * place[:, column])

        share, drag = within(prior.load_share, 1), within(prior.guide_drag, 2)
        start = np.where(steady, 1.0, within(prior.start_share, 3))
        full = share * self.pull + drag
        return Rigs(
            young=full * mean_growth(start, build_up, self.wound) / (self.area * np.exp(q[:, 0])),
            free_length=self.free_length * within(prior.free_length, 0),
            load_share=share,
            guide_drag=drag,
            start_share=start,
            build_up_length=build_up,
            held=within(prior.held, 4),
        )

    def surprise(self, q: FloatArray, rigs: Rigs) -> FloatArray:
        """Return the prior's residuals, standard normal each, shape (n, 6)."""
        deviate = np.log(rigs.young / self.young) / self.prior.young_deviation
        return np.column_stack([deviate, q[:, 1:]])

    def effective_young(self, rigs: Rigs) -> FloatArray:
        """Return E [Pa] of the cable that the stated tension alone would stretch as much, (n,)."""
        full = rigs.load_share * self.pull + rigs.guide_drag
        landed = full * mean_growth(rigs.start_share, rigs.build_up_length, self.wound)
        return np.asarray(rigs.young * self.pull / landed)

    def start(self, stress: float) -> FloatArray:
        """Return where a search begins, from the mean stress over E that markers show, (6,)."""
        return np.array([math.log(max(stress, 1.0e-4)), *np.zeros(COUNT - 1)])


def mean_growth(start: FloatArray, build_up: FloatArray, wound: float) -> FloatArray:
    """Return the mean of 1 - (1 - f) exp(-s / L_c) over a wound length [m], shape (n,).

    Args:
        start: f, shape (n,).
        build_up: L_c [m], shape (n,).
        wound: Length of cable on the cylinder [m].
    """
    decay = -np.expm1(-wound / build_up) * build_up / wound
    return np.asarray(np.maximum(1.0 - (1.0 - start) * decay, 1.0e-3))
