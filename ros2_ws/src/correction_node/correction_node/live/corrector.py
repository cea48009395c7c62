"""Turns predicted markers into corrected ones: S_corrected = h S_FEM."""

from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from correction_node.live.measured_run import implausible
from correction_node.live.neighbours import MARKERS, Neighbours, Resemblance
from correction_node.models.dataset import Array
from correction_node.models.process import NORMAL_90
from correction_node.models.weights import Factor, TrainedFactor
from winding_core.cable.cases import Case
from winding_core.markers import CORRECTED_DTYPE, MARKER_DTYPE, Markers, is_wound

# The rod lies within 1 mm of the law in the twelve cases; a wanted lay departs by a pitch.
_BESIDE_PATH = 3.0e-3


class Corrector:
    """Applies one trained correction factor.

    Args:
        trained: The trained factor.
        neighbours: The known conditions.
        law: Material law of the solver that predicts; None for the factor's own.
    """

    def __init__(
        self,
        trained: TrainedFactor,
        neighbours: Neighbours | None = None,
        *,
        law: str | None = None,
    ) -> None:
        self._trained = trained
        self._law = law
        self._neighbours = neighbours or Neighbours()
        self._factors: dict[Case, Factor] = {}

    def factor(self, condition: Case) -> Factor:
        """Return h, its bound, and whether the condition lies outside the trained ones.

        The first call for a condition works it out; ask before the run.
        """
        if condition not in self._factors:
            self._factors[condition] = self._trained.factor(condition, self._law)
        return self._factors[condition]

    def correct(self, fem_markers: Markers, condition: Case) -> Markers:
        """Return corrected records of the markers that lie on the cylinder.

        s = h S_FEM within s_low and s_high, theta and z as the place model has them for it. A
        marker that `refusals` names is left out.

        Args:
            fem_markers: MARKER_DTYPE records of the prediction, shape (n,).
            condition: What is being wound.

        Returns:
            CORRECTED_DTYPE records, shape (m,), m <= n.
        """
        wound = fem_markers[is_wound(fem_markers)]
        refused = implausible(wound, condition)
        usable = wound[[index not in refused for index in range(len(wound))]]
        factor = self.factor(condition)
        # P0 has no length to correct; it carries the h of the cable that begins there.
        h = np.array([factor.by_marker[0], *factor.by_marker])[usable["id"]]
        corrected = np.zeros(usable.shape, dtype=CORRECTED_DTYPE)
        for name in cast("tuple[str, ...]", MARKER_DTYPE.names):
            corrected[name] = usable[name]
        corrected["s_fem"] = usable["s"]
        corrected["h"] = h
        s = h * usable["s"]
        bounds = factor.bounds or (factor.relative_bound,) * condition.marker_count
        wide = np.array([bounds[0], *bounds])[usable["id"]]
        corrected["s_low"] = s * np.maximum(0.0, 1.0 - wide)
        corrected["s_high"] = s * (1.0 + wide)
        slopes = self.slopes(usable, condition)
        if slopes.any():
            corrected["z"] += np.array([0.0, *factor.z_shift])[usable["id"]]
            corrected["sigma_z"] = np.array([0.0, *factor.z_sigma])[usable["id"]]
        self.move(corrected, s, slopes)
        return corrected

    def slopes(self, fem_markers: Markers, condition: Case) -> Array:
        """Return dz / dS of P0, P1, .. along the path that places were learned on.

        Zeros where the prediction does not follow it: on a drum, or behind another guide's way.
        """
        factor, count = self.factor(condition), condition.marker_count
        slopes = np.zeros(count + 1)
        cable = (fem_markers["id"] > 0) & (fem_markers["id"] <= count)
        wound = fem_markers[is_wound(fem_markers) & cable]
        if factor.z_path:
            n = wound["id"] - 1
            along = np.array(factor.z_path)[n] + np.array(factor.z_slope)[n] * wound["s"]
            if (np.abs(wound["z"] - along) < _BESIDE_PATH).all():
                slopes[1:] = factor.z_slope
        return slopes

    def move(self, corrected: Markers, s: Array, slopes: Array) -> None:
        """Move corrected records to lengths s [m], shape (m,), with `slopes`.

        theta, z and s stay one length, s = hypot(r theta, z), and the standard deviation of theta
        becomes that of the interval of s.
        """
        cable = corrected["id"] > 0
        z = corrected["z"] + slopes[corrected["id"]] * (s - corrected["s"])
        theta = np.sqrt(np.maximum(s**2 - z**2, 0.0)) / corrected["r"]
        turned = np.where(cable, theta - corrected["theta"], 0.0)
        x, y = corrected["x"].astype(float), corrected["y"].astype(float)
        corrected["x"] = x * np.cos(turned) + y * np.sin(turned)
        corrected["y"] = y * np.cos(turned) - x * np.sin(turned)
        corrected["theta"] += turned
        corrected["z"], corrected["s"] = z, s
        wide = (corrected["s_high"] - s) / (NORMAL_90 * corrected["r"])
        corrected["sigma_theta"] = np.where(cable, wide, corrected["sigma_theta"])

    def refusals(self, fem_markers: Markers, condition: Case) -> tuple[str, ...]:
        """Return one sentence for each marker that should be corrected and is not."""
        wound = fem_markers[is_wound(fem_markers)]
        # A marker number from outside may be anything: no range is made of it.
        last = min(int(wound["id"].max(initial=0)), condition.marker_count + 1)
        missing = set(range(1, last)) - set(wound["id"].tolist())
        return (
            *implausible(wound, condition).values(),
            *(
                f"marker {marker} is missing, though a later one is wound"
                for marker in sorted(missing)
            ),
        )

    def classify(self, lengths: ArrayLike) -> Resemblance:
        """Return the known condition that measured lengths S_1, S_2, ... [m] resemble.

        Args:
            lengths: NaN where a marker is not measured; the known conditions have four markers.

        Raises:
            ValueError: None of the four is measured.
        """
        return self._neighbours.classify(np.asarray(lengths)[:MARKERS])
