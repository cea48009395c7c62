"""A mixture of t distributions that weighted draws adapt to a density (population Monte Carlo)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray

_FREEDOM = 8.0  # Heavier tails than a normal's
# Least probability of a part over that of an even one: what no draw has seen is not given up.
_LEAST = 0.03
_DRAWS_EACH = 5.0  # A part is adapted no further than so many draws for each coordinate allow


@dataclass(frozen=True, kw_only=True)
class Mixture:
    """Parts in k coordinates, each of one of two kinds."""

    share: FloatArray  # Probability of each part, sum one, shape (c,)
    middle: FloatArray  # Shape (c, k)
    spread: FloatArray  # Shape (c, k, k)
    kind: NDArray[np.bool_]  # Shape (c,)

    @classmethod
    def of(
        cls, evidence: FloatArray, middle: FloatArray, spread: FloatArray, kind: NDArray[np.bool_]
    ) -> Mixture:
        """Return the mixture of parts, see the fields.

        Args:
            evidence: ln of each part's probability but for a constant, shape (c,).
            middle: Shape (c, k).
            spread: Shape (c, k, k).
            kind: Shape (c,).
        """
        share = np.exp(evidence - evidence.max())
        return cls(share=_floored(share), middle=middle, spread=spread, kind=kind)

    def draw(self, rng: np.random.Generator, count: int) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return draws, shape (n, k), and the kind of each, shape (n,).

        They come in pairs to either side of a middle, which is not left to chance.
        """
        ends = np.concatenate([[0.0], np.cumsum(self.share)[:-1]])
        part = np.searchsorted(ends, (np.arange(count) + rng.random()) / count, side="right") - 1
        normal = rng.standard_normal((count, self.middle.shape[1]))
        normal[1::2] = -normal[: count - 1 : 2]
        tail = np.repeat(np.sqrt(_FREEDOM / rng.chisquare(_FREEDOM, (count + 1) // 2)), 2)[:count]
        root = np.linalg.cholesky(self.spread)[part]
        off = np.einsum("nij,nj->ni", root, normal * tail[:, None])
        return self.middle[part] + off, self.kind[part]

    def densities(self, draws: FloatArray, kind: NDArray[np.bool_]) -> FloatArray:
        """Return ln of each part's density at draws, but for a constant, shape (n, c)."""
        white = np.linalg.inv(np.linalg.cholesky(self.spread))
        off = np.einsum("cij,ncj->nci", white, draws[:, None] - self.middle)
        tail = (_FREEDOM + draws.shape[1]) * np.log1p((off**2).sum(axis=2) / _FREEDOM)
        volume = np.log(np.diagonal(white, axis1=1, axis2=2)).sum(axis=1)
        own = kind[:, None] == self.kind
        return np.where(own, np.log(self.share) + volume - 0.5 * tail, -np.inf)

    def adapted(self, draws: FloatArray, kind: NDArray[np.bool_], weights: FloatArray) -> Mixture:
        """Return the mixture with the moments of weighted draws (Cappe et al., Stat. Comput. 18).

        Args:
            draws: Shape (n, k).
            kind: Shape (n,).
            weights: Sum one, shape (n,).
        """
        found = self.densities(draws, kind)
        part = np.exp(found - np.logaddexp.reduce(found, axis=1, keepdims=True))
        part *= weights[:, None]
        total = part.sum(axis=0)
        part /= np.maximum(total, 1.0e-300)
        # Few draws that count leave a covariance of low rank: the one before fills it up.
        known = 1.0 / np.maximum((part**2).sum(axis=0), 1.0e-300)
        trust = np.minimum(1.0, known / (_DRAWS_EACH * draws.shape[1]))
        trust = np.where(total > 1.0e-12, trust, 0.0)
        middle = self.middle + trust[:, None] * (part.T @ draws - self.middle)
        off = draws[:, None] - middle
        seen = np.einsum("nc,nci,ncj->cij", part, off, off)
        spread = self.spread + trust[:, None, None] * (seen - self.spread)
        return Mixture(share=_floored(total), middle=middle, spread=spread, kind=self.kind)


def weighted_draws(
    mixture: Mixture,
    density: Callable[[FloatArray, NDArray[np.bool_]], FloatArray],
    count: int,
    *,
    rounds: int,
    enough: float,
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Return draws, shape (n, k), their kinds, (n,), and weights, (n,), which sum to one.

    The same at every call. Weights are cut at the root of the number of draws over their mean
    (Ionides, J. Comput. Graph. Stat. 17, 2008).

    Args:
        mixture: Where to begin.
        density: Returns ln of the density that is sought, but for a constant, shape (n,).
        count: How many draws.
        rounds: How often the mixture is adapted at most.
        enough: Share of the draws that must count for it to be left as it is, dimensionless.
    """
    rng = np.random.default_rng(0)
    while True:
        draws, kind = mixture.draw(rng, count)
        weights = density(draws, kind)
        weights -= np.logaddexp.reduce(mixture.densities(draws, kind), axis=1)
        weights = np.exp(weights - weights.max())
        weights = np.minimum(weights, weights.mean() * np.sqrt(count))
        weights /= weights.sum()
        if rounds == 0 or 1.0 / float(weights @ weights) >= enough * count:
            return draws, kind, weights
        mixture, rounds = mixture.adapted(draws, kind, weights), rounds - 1


def _floored(share: FloatArray) -> FloatArray:
    found = share / share.sum()
    found = np.maximum(found, _LEAST / share.size)
    return np.asarray(found / found.sum())
