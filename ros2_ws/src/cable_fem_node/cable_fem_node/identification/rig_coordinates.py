"""Coordinates in which what markers tell of a rig is straight, and what they do not is normal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.identification.rig import RigPrior, Rigs

# ln of the mean landed stress over E; then free length, load share, drag and start share, each as
# the normal deviate of its place in its range.
COUNT = 5
_FARTHEST = 8.0


@dataclass(frozen=True, kw_only=True)
class RigCoordinates:
    """From coordinates (n, 5), build-up lengths and whether the tension is steady to rigs.

    Markers tell the stretch at which the cable was laid and not what made it: E, load share and
    drag hide behind each other. So the first coordinate is that stretch, and E follows.

    Attributes:
        prior: What was known.
        young: E as configured [Pa].
        free_length: As configured [m].
        pull: Mean stated tension while the markers were wound [N].
        area: That carries it [m^2].
        wound: Length of cable on the cylinder up to the last marker that was used [m].
    """

    prior: RigPrior
    young: float
    free_length: float
    pull: float
    area: float
    wound: float

    def rigs(self, q: FloatArray, build_up: FloatArray, steady: NDArray[np.bool_]) -> Rigs:
        """Return the rigs.

        Args:
            q: Shape (n, 5).
            build_up: L_c [m], shape (n,).
            steady: True where the tension does not build up, shape (n,).
        """
        from scipy.special import ndtr  # noqa: PLC0415 - live, beside the machine

        place = ndtr(np.clip(q[:, 1:], -_FARTHEST, _FARTHEST))
        prior = self.prior

        def within(limits: tuple[float, float], column: int) -> FloatArray:
            low, high = limits
            return np.asarray(low + (high - low) * place[:, column])

        share, drag = within(prior.load_share, 1), within(prior.guide_drag, 2)
        start = np.where(steady, 1.0, within(prior.start_share, 3))
        full = share * self.pull + drag
        return Rigs(
            young=full * self._mean_growth(start, build_up) / (self.area * np.exp(q[:, 0])),
            free_length=self.free_length * within(prior.free_length, 0),
            load_share=share,
            guide_drag=drag,
            start_share=start,
            build_up_length=build_up,
        )

    def surprise(self, q: FloatArray, rigs: Rigs) -> FloatArray:
        """Return the prior's residuals, standard normal each, shape (n, 5)."""
        deviate = np.log(rigs.young / self.young) / self.prior.young_deviation
        return np.column_stack([deviate, q[:, 1:]])

    def effective_young(self, rigs: Rigs) -> FloatArray:
        """Return E [Pa] of the cable that the stated tension alone would stretch as much, (n,)."""
        full = rigs.load_share * self.pull + rigs.guide_drag
        landed = full * self._mean_growth(rigs.start_share, rigs.build_up_length)
        return np.asarray(rigs.young * self.pull / landed)

    def _mean_growth(self, start: FloatArray, build_up: FloatArray) -> FloatArray:
        decay = -np.expm1(-self.wound / build_up) * build_up / self.wound
        return np.asarray(np.maximum(1.0 - (1.0 - start) * decay, 1.0e-3))

    def start(self, stress: float) -> FloatArray:
        """Return where a search begins, from the mean stress over E that markers show, (5,)."""
        return np.array([math.log(max(stress, 1.0e-4)), 0.0, 0.0, 0.0, 0.0])
