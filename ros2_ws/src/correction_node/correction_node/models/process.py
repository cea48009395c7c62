"""A Gaussian process in plain NumPy: what physics leaves over, and how well that is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from correction_node.models.dataset import Array

# Half of the 90 % interval of a normal variable, in standard deviations.
NORMAL_90 = 1.6449
# Ranges of the scales, in spreads of an input, and of the deviations of smooth part, run and
# reading, in root mean squares of what is explained; the search begins at the first of three.
_SCALES = (1.0, 0.3, 100.0)
_DEVIATIONS = ((1.0, 0.05, 10.0), (0.1, 1.0e-3, 2.0), (0.5, 1.0e-3, 2.0))
# An input that hardly varies, relative: its scale is not identified but a tenth of its value.
_CONSTANT, _LEAST_SPREAD = 1.0e-3, 0.1


@dataclass(frozen=True, kw_only=True)
class Process:
    """y(x) = a smooth function + what a run has of its own + noise, all normal.

    Far from everything it was learned from it is zero with the standard deviation that it found
    from place to place, which is no forecast.

    Attributes:
        inputs: Where it was learned, standardised, shape (n, k).
        spread: What one unit of a standardised input is, shape (k,).
        scales: Length scales of the smooth part in these units, shape (k,).
        deviations: Of the smooth part, of a whole run, and of one reading, shape (3,).
        weights: Of the kernel at `inputs`, shape (n,).
        factor: Cholesky factor of the covariance of the readings, shape (n, n).
    """

    inputs: Array
    mean: Array  # Of the inputs, shape (k,)
    spread: Array
    scales: Array
    deviations: Array
    weights: Array
    factor: Array

    @classmethod
    def fit(
        cls, inputs: Array, y: Array, runs: NDArray[np.int64], sigma: Array | float = 0.0
    ) -> Self:
        """Return the process whose scales and deviations make the readings most likely.

        Args:
            inputs: Shape (n, k).
            y: What is explained, shape (n,).
            runs: Run of each row, shape (n,).
            sigma: Known standard deviation of each reading, shape (n,).
        """
        from scipy.optimize import minimize  # noqa: PLC0415

        mean = inputs.mean(axis=0)
        spread = inputs.std(axis=0)
        still = spread <= _CONSTANT * np.abs(mean)
        spread = np.where(still, np.maximum(_LEAST_SPREAD * np.abs(mean), 1.0e-6), spread)
        scaled = (inputs - mean) / spread
        size = max(float(np.sqrt(np.mean(y**2))), 1.0e-9)
        same = (runs[:, np.newaxis] == runs).astype(float)
        known = np.diag(np.broadcast_to(np.square(np.asarray(sigma) / size), y.shape))
        ranges = np.log([_SCALES] * inputs.shape[1] + list(_DEVIATIONS))

        def factor(asked: Array) -> Array:
            smooth, run, noise = np.exp(2.0 * asked[-3:])
            covariance = smooth * _kernel(scaled, scaled, np.exp(asked[:-3])) + run * same + known
            return np.linalg.cholesky(covariance + (noise + 1.0e-9) * np.eye(len(y)))

        def loss(asked: Array) -> float:
            root = factor(asked)
            left = np.linalg.solve(root, y / size)
            return float(0.5 * (left @ left) + np.log(np.diag(root)).sum())

        found = minimize(loss, ranges[:, 0], method="L-BFGS-B", bounds=ranges[:, 1:]).x
        root = size * factor(found)
        return cls(
            inputs=scaled,
            mean=mean,
            spread=spread,
            scales=np.exp(found[:-3]),
            deviations=size * np.exp(found[-3:]),
            weights=np.linalg.solve(root.T, np.linalg.solve(root, y)),
            factor=root,
        )

    def at(self, inputs: Array) -> tuple[Array, Array]:
        """Return (mean, standard deviation of a reading of a new run), each of shape (m,)."""
        smooth, run, noise = np.square(self.deviations)
        scaled = (inputs - self.mean) / self.spread
        kernel = smooth * _kernel(scaled, self.inputs, self.scales)
        known = np.square(np.linalg.solve(self.factor, kernel.T)).sum(axis=0)
        variance = np.maximum(smooth - known, 0.0) + run + noise
        return np.asarray(kernel @ self.weights), np.sqrt(variance)

    def tensors(self, prefix: str) -> dict[str, Array]:
        """Return every number by name; `read` takes them back."""
        return {f"{prefix}.{item.name}": getattr(self, item.name) for item in fields(self)}

    @classmethod
    def read(cls, prefix: str, tensors: Mapping[str, Array]) -> Self:
        """Return the process that `tensors` describe.

        Raises:
            KeyError, ValueError: They do not.
        """
        found = cls(**{item.name: tensors[f"{prefix}.{item.name}"] for item in fields(cls)})
        # What does not fit together fails here, not in the middle of a run.
        found.at(found.mean[np.newaxis])
        return found


def _kernel(left: Array, right: Array, scales: Array) -> Array:
    apart = (left[:, np.newaxis] - right) / scales
    return np.asarray(np.exp(-0.5 * np.square(apart).sum(axis=2)))
