"""Where the markers that have not landed will lie, and how well that is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.identification.rig_part import RigPart
from cable_fem_node.identification.weighted import interval_of


@dataclass(frozen=True, kw_only=True)
class MarkerAhead:
    """A marker that was not used.

    Attributes:
        id: n of Pn.
        theta: Wound angle [rad].
        sigma_theta: One standard deviation [rad].
        z: Axial position [m].
        sigma_z: [m]
        s: Curve length [m].
        low: 5 % lie below this s [m].
        high: 5 % lie above [m].
    """

    id: int
    theta: float
    sigma_theta: float
    z: float
    sigma_z: float
    s: float
    low: float
    high: float

    @property
    def half_width_90(self) -> float:
        """Half of the 90 % interval of s [m]."""
        return 0.5 * (self.high - self.low)


def markers_ahead(
    part: RigPart, theta: FloatArray, z: FloatArray, weights: FloatArray
) -> tuple[MarkerAhead, ...]:
    """Return the markers of a run that were not used.

    What the used markers miss is carried on by the covariance of model and machine: an offset
    of P0 shifts all of them.

    Args:
        part: The run.
        theta: Of all markers on each drawn rig [rad], shape (n, m).
        z: [m], shape (n, m).
        weights: Sum one, shape (n,).
    """
    count = part.lay.arc.size
    unused = np.setdiff1d(np.arange(count), part.used)
    if unused.size == 0:
        return ()
    rng = np.random.default_rng(1)
    readings, deviations = part.run.readings, part.deviations
    theta = _carried(
        theta, part, unused, readings.theta, deviations.theta, readings.sigma_theta, rng
    )
    z = _carried(z, part, unused, readings.z, deviations.z, readings.sigma_z, rng)
    s = np.hypot(part.run.config.case.centreline_radius * theta, z)
    rows = []
    for column, marker in enumerate(unused.tolist()):
        low, high = interval_of(s[:, column], weights)
        means = [float(weights @ values[:, column]) for values in (theta, z, s)]
        spreads = [
            float(np.sqrt(weights @ (values[:, column] - mean) ** 2))
            for values, mean in zip((theta, z), means, strict=False)
        ]
        rows.append(
            MarkerAhead(
                id=marker + 1,
                theta=means[0],
                sigma_theta=spreads[0],
                z=means[1],
                sigma_z=spreads[1],
                s=means[2],
                low=low,
                high=high,
            )
        )
    return tuple(rows)


def _carried(
    laid: FloatArray,
    part: RigPart,
    unused: NDArray[np.intp],
    measured: FloatArray,
    deviations: FloatArray,
    sigma: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """Return one draw of the unused markers' places for each rig, shape (n, u)."""
    used = part.used
    seen = deviations[np.ix_(used, used)] + np.diag(sigma**2)
    across = deviations[np.ix_(unused, used)]
    gain = np.linalg.solve(seen, across.T).T
    left = deviations[np.ix_(unused, unused)] - gain @ across.T
    # Rounding may leave an eigenvalue a little below zero.
    size, way = np.linalg.eigh(left)
    noise = rng.standard_normal((laid.shape[0], unused.size)) * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(laid[:, unused] + (measured - laid[:, used]) @ gain.T + noise @ way.T)
