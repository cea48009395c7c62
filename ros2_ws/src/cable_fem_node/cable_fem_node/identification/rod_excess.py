"""How far the rod's markers lie from the closed form's: what one search leaves to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.points import FloatArray


@dataclass(frozen=True, kw_only=True)
class RodExcess:
    """What the rod said of one run's markers at the last material that it was asked for.

    Attributes:
        parameters: Of that material, shape (p,).
        ids: n of Pn, ascending, shape (m,).
        excess: Of the angles relative to the closed form's, then of z [m], shape (2 m,).
        slope: Its change per parameter, shape (2 m, p).
    """

    parameters: FloatArray
    ids: NDArray[np.int64]
    excess: FloatArray
    slope: FloatArray

    def expected_for(self, ids: NDArray[np.int64]) -> RodExcess:
        """Return what is to be expected of markers, which may have become more, shape (k,).

        A share of the angle and a distance along the axis change little from one marker to the
        next: one that the rod was not asked for takes those of the nearest before it.
        """
        nearest = np.maximum(np.searchsorted(self.ids, ids, side="right") - 1, 0)
        rows = np.concatenate([nearest, nearest + self.ids.size])
        return RodExcess(
            parameters=self.parameters, ids=ids, excess=self.excess[rows], slope=self.slope[rows]
        )
