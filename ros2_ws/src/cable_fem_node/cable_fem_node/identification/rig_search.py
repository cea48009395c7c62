"""The posterior of a rig: Gaussian in six coordinates along a quadrature over the build-up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.levenberg import optimum, student
from cable_fem_node.identification.rig import COUNT, RigCoordinates, Rigs
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_part import RigPart
from cable_fem_node.identification.tracked_run import TrackedRun
from cable_fem_node.winding.rig_prior import RigPrior

# Places along ln L_c; as many again where the first ones found the mass.
_NODES = 8
_REFINEMENTS = 2
_NEGLIGIBLE = 1.0e-4
_STEPS = 25
_PROBE = 1.0e-4
# Twice the gain in half a sum of squares below which a step is not worth taking.
_SETTLED = 2.0e-3
# Heavier tails than the posterior's.
_FREEDOM = 6.0


@dataclass(frozen=True, kw_only=True)
class _Modes:
    """The best coordinates at each place along the build-up."""

    build_up: FloatArray  # L_c [m], shape (c,)
    width: FloatArray  # Of the cell in ln L_c, shape (c,)
    steady: NDArray[np.bool_]  # True for the rig whose tension does not build up, shape (c,)
    prior: FloatArray  # ln of the prior probability of the cell, shape (c,)
    best: FloatArray  # Shape (c, 6)
    information: FloatArray  # Shape (c, 6, 6)
    cost: FloatArray  # Half the sum of squares, shape (c,)

    @property
    def evidence(self) -> FloatArray:
        """Logarithm of each cell's part of the evidence, but for a constant, shape (c,)."""
        _, volume = np.linalg.slogdet(self.information)
        return np.asarray(self.prior - self.cost - 0.5 * volume)


class RigSearch:
    """Finds and draws the rigs that explain where markers lie.

    Args:
        runs: Of one cable on one rig, at least one.
        prior: What was known before.
        lays: Closed forms of the runs.
    """

    def __init__(self, runs: Sequence[TrackedRun], prior: RigPrior, lays: Sequence[RigLay]) -> None:
        self.parts = [RigPart.of(run, lay, prior) for run, lay in zip(runs, lays, strict=True)]
        self.prior = prior
        first, config = runs[0].readings, runs[0].config
        case, last = config.case, float(first.theta[-1])
        self.coordinates = RigCoordinates(
            prior=prior,
            young=case.material.young,
            free_length=config.free_length,
            pull=lays[0].mean_pull(last),
            area=case.axial_area,
            wound=case.centreline_radius * last,
        )
        length = math.hypot(case.centreline_radius * last, float(first.z[-1]))
        stretch = length / (float(first.ids[-1]) * case.marker_spacing)
        self._start = self.coordinates.start(lays[0].stress_of(stretch))
        self.modes = self._find()

    @property
    def measured(self) -> int:
        """How many numbers were measured."""
        return sum(2 * part.used.size for part in self.parts)

    @property
    def chi_square(self) -> float:
        """Sum of squares of the best rig, prior included."""
        return 2.0 * float(self.modes.cost[np.argmax(self.modes.evidence)])

    @property
    def evidence(self) -> float:
        """Logarithm of the density of the measurements, but for a constant of the runs."""
        whitened = sum(
            float(np.log(np.diag(white)).sum())
            for part in self.parts
            for white in (part.white_theta, part.white_z)
        )
        return whitened + float(np.logaddexp.reduce(self.modes.evidence))

    def draw(self, count: int) -> tuple[Rigs, FloatArray]:
        """Return rigs and their weights, which sum to one; the same at every call.

        Args:
            count: How many rigs.
        """
        rng = np.random.default_rng(0)
        modes, evidence = self.modes, self.modes.evidence
        share = np.exp(evidence - np.logaddexp.reduce(evidence))
        ends = np.concatenate([[0.0], np.cumsum(share)[:-1]])
        cell = np.searchsorted(ends, (np.arange(count) + rng.random()) / count, side="right") - 1
        moved = modes.width[cell] * (rng.random(count) - 0.5)
        build_up = modes.build_up[cell] * np.exp(moved)
        spread = np.linalg.cholesky(np.linalg.inv(modes.information))
        drawn, proposed = student(rng, count, COUNT, _FREEDOM)
        q = modes.best[cell] + self._slopes()[cell] * moved[:, None]
        q = q + np.einsum("nij,nj->ni", spread[cell], drawn)
        residuals, rigs = self._residuals(q, build_up, modes.steady[cell])
        _, volume = np.linalg.slogdet(modes.information)
        proposed = proposed + 0.5 * volume[cell] + evidence[cell]
        weight = modes.prior[cell] - 0.5 * (residuals**2).sum(axis=1) - proposed
        weight = np.exp(weight - weight.max())
        return rigs, weight / weight.sum()

    def _slopes(self) -> FloatArray:
        """Return how the best coordinates move along ln L_c, shape (c, 6)."""
        modes = self.modes
        slopes = np.zeros_like(modes.best)
        growing = np.flatnonzero(~modes.steady)
        if growing.size > 1:
            slopes[growing] = np.gradient(
                modes.best[growing], np.log(modes.build_up[growing]), axis=0
            )
        return slopes

    def _residuals(
        self, q: FloatArray, build_up: FloatArray, steady: NDArray[np.bool_]
    ) -> tuple[FloatArray, Rigs]:
        rigs = self.coordinates.rigs(q, build_up, steady)
        parts = [part.residuals(rigs) for part in self.parts]
        return np.hstack([*parts, self.coordinates.surprise(q, rigs)]), rigs

    def _find(self) -> _Modes:
        steady = self.prior.steady
        low, high = (math.log(length) for length in self.prior.build_up_length)
        found = []
        if steady:
            # Any build-up length explains a tension that does not build up.
            found.append(self._modes(np.array([0.5 * (low + high)]), high - low, steady=True))
        if steady < 1.0:
            density = math.log(1.0 - steady) - (math.log(high - low) if high > low else 0.0)
            growing = self._cells(low, high, density)
            for _ in range(_REFINEMENTS if high > low else 0):
                heavy = np.flatnonzero(
                    growing.evidence > growing.evidence.max() + math.log(_NEGLIGIBLE)
                )
                if heavy.size > _NODES // 2:
                    break
                edges = np.log(growing.build_up[heavy[[0, -1]]])
                margin = growing.width[0]
                growing = self._cells(
                    max(low, edges[0] - margin), min(high, edges[1] + margin), density, growing
                )
            found.append(growing)
        return found[0] if len(found) == 1 else _joined(*found)

    def _cells(
        self, low: float, high: float, density: float, before: _Modes | None = None
    ) -> _Modes:
        if not high > low:
            return self._modes(np.array([low]), 0.0, steady=False, prior=density)
        width = (high - low) / _NODES
        places = np.asarray(low + width * (np.arange(_NODES) + 0.5), dtype=np.float64)
        start = None
        if before is not None:
            known = np.log(before.build_up)
            start = np.column_stack([np.interp(places, known, q) for q in before.best.T])
        return self._modes(
            places, width, steady=False, prior=density + math.log(width), start=start
        )

    def _modes(
        self,
        places: FloatArray,
        width: float,
        *,
        steady: bool,
        prior: float | None = None,
        start: FloatArray | None = None,
    ) -> _Modes:
        """Return the best coordinates at each ln L_c."""
        count = places.size
        build_up, flags = np.exp(places), np.full(count, steady)

        def residuals(q: FloatArray) -> FloatArray:
            repeated = (np.repeat(values, COUNT + 1) for values in (build_up, flags))
            rows, _ = self._residuals(q.reshape(-1, COUNT), *repeated)
            return rows.reshape(count, COUNT + 1, -1)

        q, information, cost = optimum(
            residuals,
            np.tile(self._start, (count, 1)) if start is None else start,
            probe=_PROBE,
            steps=_STEPS,
            settled=_SETTLED,
        )
        return _Modes(
            build_up=build_up,
            width=np.full(count, width),
            steady=flags,
            prior=np.full(count, math.log(self.prior.steady) if prior is None else prior),
            best=q,
            information=information,
            cost=cost,
        )


def _joined(one: _Modes, other: _Modes) -> _Modes:
    return _Modes(
        **{
            name: np.concatenate([getattr(one, name), getattr(other, name)])
            for name in _Modes.__dataclass_fields__
        }
    )
