"""Turns predicted markers into corrected ones: S_corrected = h S_FEM."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_winding.cases import Case
from cable_winding.markers import CORRECTED_DTYPE, MARKER_DTYPE, Markers, is_wound
from correction_node.neighbours import Neighbours, Resemblance
from correction_node.weights import Factor, TrainedWeight


class Corrector:
    """Applies one trained weight.

    Args:
        weight: The trained weight.
        neighbours: The known conditions.
    """

    def __init__(self, weight: TrainedWeight, neighbours: Neighbours | None = None) -> None:
        self._weight = weight
        self._neighbours = neighbours or Neighbours()

    def factor(self, condition: Case) -> Factor:
        """Return h, its bound, and whether the condition lies outside the trained ones."""
        return self._weight.factor(condition)

    def correct(self, fem_markers: Markers, condition: Case) -> Markers:
        """Return corrected records of the markers that lie on the cylinder.

        s = h S_FEM within s_low and s_high; everything else stays the prediction's. A marker
        that `refusals` names is left out.

        Args:
            fem_markers: MARKER_DTYPE records of the prediction, shape (n,).
            condition: What is being wound.

        Returns:
            CORRECTED_DTYPE records, shape (m,), m <= n.
        """
        usable = fem_markers[is_wound(fem_markers) & ~_implausible(fem_markers)]
        factor = self.factor(condition)
        corrected = np.zeros(usable.shape, dtype=CORRECTED_DTYPE)
        for name in cast("tuple[str, ...]", MARKER_DTYPE.names):
            corrected[name] = usable[name]
        corrected["s_fem"] = usable["s"]
        corrected["h"] = factor.h
        corrected["s"] = factor.h * usable["s"]
        corrected["s_low"] = corrected["s"] * max(0.0, 1.0 - factor.relative_bound)
        corrected["s_high"] = corrected["s"] * (1.0 + factor.relative_bound)
        return corrected

    def refusals(self, fem_markers: Markers) -> tuple[str, ...]:
        """Return one sentence for each wound marker that is not corrected."""
        refused = fem_markers[is_wound(fem_markers) & _implausible(fem_markers)]
        return tuple(
            f"marker {int(marker['id'])} has no usable length, got {float(marker['s'])} m"
            for marker in refused
        )

    def classify(self, lengths: ArrayLike) -> Resemblance:
        """Return the known condition that measured lengths S_1..S_4 [m] resemble; NaN: missing."""
        return self._neighbours.classify(lengths)


def _implausible(markers: Markers) -> NDArray[np.bool_]:
    length = markers["s"]
    # P0 stands at the origin of S; every other marker has cable before it.
    return np.asarray(
        ~np.isfinite(length) | (length < 0.0) | ((length == 0.0) & (markers["id"] > 0))
    )
