"""Gaussian process over what a base model leaves unexplained: a second opinion with an interval."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from correction_node.models.dataset import Array, LengthCell, MarkerCondition, lengths
from correction_node.models.evaluation import Model
from correction_node.models.inputs import dimensionless_inputs

# Relative repeatability of a measured length, assumed: the paper's K-NN accuracy asks for it.
NOISE = 0.006
# Prior: h strays from the base by a tenth or so; a length scale is about one spread of an input.
_VARIANCE = 0.01
_VARIANCE_RANGE = (1.0e-5, 1.0)
_SCALE_RANGE = (0.3, 100.0)


@dataclass(frozen=True, kw_only=True)
class GaussianProcess:
    """ln(S / S_base) as a Gaussian process over the dimensionless inputs.

    Attributes:
        base: h of the base model.
        regressor: Fitted to standardised inputs.
        mean: Of the training inputs, shape (k,).
        spread: Standard deviation of the training inputs, shape (k,).
    """

    base: Model
    regressor: GaussianProcessRegressor
    mean: Array
    spread: Array

    def h(self, conditions: Sequence[MarkerCondition]) -> Array:
        """Return h, shape (n,): the median."""
        return np.asarray(
            self.base(conditions) * np.exp(self.regressor.predict(self._scaled(conditions)))
        )

    def bounds(self, conditions: Sequence[MarkerCondition], level: float) -> tuple[Array, Array]:
        """Return (low, high) h between which a measured length lies with a probability.

        The process's own belief, noise of the measurement included; whether it is right, only
        left-out cases can tell.
        """
        mean, deviation = self.regressor.predict(self._scaled(conditions), return_std=True)
        reach = norm.ppf(0.5 + 0.5 * level) * np.hypot(deviation, NOISE)
        base = self.base(conditions)
        return np.asarray(base * np.exp(mean - reach)), np.asarray(base * np.exp(mean + reach))

    def _scaled(self, conditions: Sequence[MarkerCondition]) -> Array:
        return np.asarray((dimensionless_inputs(conditions) - self.mean) / self.spread)


def learn_process(cells: Sequence[LengthCell], base: Model) -> GaussianProcess:
    """Return the process that explains measured lengths; its scales by maximum likelihood.

    Args:
        cells: Measured cells.
        base: h of the model to build on; must have been learned from these cells only.
    """
    inputs = dimensionless_inputs(cells)
    mean, spread = inputs.mean(axis=0), inputs.std(axis=0)
    s_fem, s_exp = lengths(cells)
    kernel = ConstantKernel(_VARIANCE, _VARIANCE_RANGE) * Matern(
        np.ones(inputs.shape[1]), _SCALE_RANGE, nu=2.5
    )
    regressor = GaussianProcessRegressor(kernel, alpha=NOISE**2)
    with warnings.catch_warnings():
        # A scale at the end of its range says that an input does not matter, or matters abruptly.
        warnings.simplefilter("ignore", ConvergenceWarning)
        regressor.fit((inputs - mean) / spread, np.log(s_exp / (base(cells) * s_fem)))
    return GaussianProcess(base=base, regressor=regressor, mean=mean, spread=spread)
