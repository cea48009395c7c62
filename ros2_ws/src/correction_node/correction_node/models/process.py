"""A Gaussian process in plain NumPy: what physics leaves over, and how well that is known."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from correction_node.models.dataset import Array

NORMAL_90 = 1.6449  # Half of the 90 % interval of a normal variable, in standard deviations
# Ranges of the scales, in spreads of an input, and of the deviations of smooth part, run (at the
# root mean square of its effects) and reading, in root mean squares of what is explained; the
# search begins at the first of three.
_SCALES = (1.0, 0.3, 100.0)
_DEVIATIONS = ((1.0, 0.05, 10.0), (0.1, 1.0e-3, 2.0), (0.5, 1.0e-3, 2.0))
# An input that hardly varies, relative: its scale is not identified but a tenth of its value.
_CONSTANT, _LEAST_SPREAD = 1.0e-3, 0.1
_NONE = np.finfo(float).tiny


@dataclass(frozen=True, kw_only=True)
class Process:
    """y(x) = a smooth function + what a run has of its own + noise, all normal.

    Far from everything it was learned from it is zero with the standard deviation that it found
    from place to place, which is no forecast.
    """

    inputs: Array  # Where it was learned, standardised, shape (n, k)
    mean: Array  # Of the inputs, shape (k,)
    spread: Array  # What one unit of a standardised input is, shape (k,)
    scales: Array  # Length scales of the smooth part in these units, shape (k,)
    deviations: Array  # Of the smooth part, of a whole run, and of one reading, shape (3,)
    weights: Array  # Of the kernel at `inputs`, shape (n,)
    factor: Array  # Cholesky factor of the covariance of the readings, shape (n, n)
    # Degrees of freedom from which the deviations of a run and of a reading were found, shape (2,).
    freedom: Array

    @classmethod
    def fit(
        cls,
        inputs: Array,
        y: Array,
        runs: NDArray[np.int64],
        sigma: Array | float = 0.0,
        effect: Array | float = 1.0,
    ) -> Self:
        """Return the process whose scales and deviations make the readings most likely.

        Args:
            inputs: Shape (n, k).
            y: What is explained, shape (n,).
            runs: Run of each row, shape (n,).
            sigma: Known standard deviation of each reading, shape (n,).
            effect: Change of each reading with a unit of what its run has of its own, shape (n,).
        """
        from scipy.optimize import minimize  # noqa: PLC0415

        mean = inputs.mean(axis=0)
        spread = inputs.std(axis=0)
        still = spread <= _CONSTANT * np.abs(mean)
        spread = np.where(still, np.maximum(_LEAST_SPREAD * np.abs(mean), 1.0e-6), spread)
        scaled = (inputs - mean) / spread
        size = max(float(np.sqrt(np.mean(y**2))), 1.0e-9)
        effects = np.broadcast_to(effect, y.shape)
        reach = max(float(np.sqrt(np.mean(effects**2))), _NONE)
        effects = effects / reach
        same = np.where(runs[:, np.newaxis] == runs, np.outer(effects, effects), 0.0)
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
        deviations = size * np.exp(found[-3:])
        deviations[1] /= reach
        # A reading to come scatters like the known ones.
        deviations[2] = np.hypot(deviations[2], np.sqrt(np.mean(np.square(sigma))))
        kernel = deviations[0] ** 2 * _kernel(scaled, scaled, np.exp(found[:-3]))
        return cls(
            inputs=scaled,
            mean=mean,
            spread=spread,
            scales=np.exp(found[:-3]),
            deviations=deviations,
            weights=np.linalg.solve(root.T, np.linalg.solve(root, y)),
            factor=root,
            freedom=_freedom(kernel, root, runs),
        )

    def half_width(self, inputs: Array, effect: Array | float = 1.0) -> Array:
        """Return half of the 90 % interval of a reading of a new run, shape (m,).

        Student's t of the variances' degrees of freedom (Satterthwaite, Biometrics Bulletin 2,
        1946): the deviation of a run is found from few of them.
        """
        from scipy.special import stdtrit  # noqa: PLC0415

        _, deviation = self.at(inputs, effect)
        _, run, noise = np.square(self.deviations)
        spread = (run * np.square(effect)) ** 2 / self.freedom[0] + noise**2 / self.freedom[1]
        return np.asarray(deviation * stdtrit(deviation**4 / np.maximum(spread, _NONE), 0.95))

    def at(self, inputs: Array, effect: Array | float = 1.0) -> tuple[Array, Array]:
        """Return (mean, standard deviation of a reading of a new run), each of shape (m,).

        Args:
            inputs: Shape (m, k).
            effect: Of what the run has of its own, see `fit`, shape (m,).
        """
        smooth, run, noise = np.square(self.deviations)
        scaled = (inputs - self.mean) / self.spread
        kernel = smooth * _kernel(scaled, self.inputs, self.scales)
        known = np.square(np.linalg.solve(self.factor, kernel.T)).sum(axis=0)
        variance = np.maximum(smooth - known, 0.0) + run * np.square(effect) + noise
        return np.asarray(kernel @ self.weights), np.sqrt(variance)

    def tensors(self, prefix: str) -> dict[str, Array]:
        """Return every number by name; `read` takes them back."""
        found = {f"{prefix}.{item.name}": getattr(self, item.name) for item in fields(self)}
        return {name: numbers for name, numbers in found.items() if np.isfinite(numbers).all()}

    @classmethod
    def read(cls, prefix: str, tensors: Mapping[str, Array]) -> Self:
        """Return the process that `tensors` describe.

        Raises:
            KeyError, ValueError: They do not.
        """
        # Weights of before these were kept have normal intervals.
        known = {f"{prefix}.freedom": np.full(2, np.inf), **tensors}
        found = cls(**{item.name: known[f"{prefix}.{item.name}"] for item in fields(cls)})
        # What does not fit together fails here, not in the middle of a run.
        found.at(found.mean[np.newaxis])
        return found


def _freedom(kernel: Array, root: Array, runs: NDArray[np.int64]) -> Array:
    """Return what is left of runs and of their readings beside the smooth part, shape (2,)."""
    _, which = np.unique(runs, return_inverse=True)
    of_run = np.eye(which.max() + 1)[which]
    smoother = np.linalg.solve(root.T, np.linalg.solve(root, kernel)).T
    count = of_run.sum(axis=0)
    between = float(np.trace((of_run / count).T @ smoother @ of_run))
    within = float(np.trace(smoother)) - between
    return np.maximum([len(count) - between, len(which) - len(count) - within], 1.0)


def _kernel(left: Array, right: Array, scales: Array) -> Array:
    apart = (left[:, np.newaxis] - right) / scales
    return np.asarray(np.exp(-0.5 * np.square(apart).sum(axis=2)))
