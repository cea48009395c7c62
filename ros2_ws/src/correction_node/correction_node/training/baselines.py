"""Plain rivals of the learned models: what a sceptic would try first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from correction_node.models.dataset import Array, LengthCell, MarkerCondition, lengths
from correction_node.models.evaluation import Fit, Model
from correction_node.models.inputs import Inputs, condition_inputs, dimensionless_inputs
from winding_core.cable.cases import Material

RIDGE_PENALTY = 1.0


def no_correction(cells: Sequence[LengthCell]) -> Model:
    """Learn nothing: h = 1."""
    return lambda asked: np.ones(len(asked))


def no_stretch(cells: Sequence[LengthCell]) -> Model:
    """Learn nothing, ask no solver: S_n = n spacings."""
    return lambda asked: np.array([c.original_length / c.s_fem for c in asked])


def hooke_stretch(cells: Sequence[LengthCell]) -> Model:
    """Learn nothing, ask no solver: S_n = n spacings (1 + sigma / E)."""
    young = Material().young
    return lambda asked: np.array(
        [c.original_length * (1.0 + c.tension / young) / c.s_fem for c in asked]
    )


def constant_factor(cells: Sequence[LengthCell]) -> Model:
    """One h for everything, the minimum of Eq. 5."""
    s_fem, s_exp = lengths(cells)
    h = float(s_fem @ s_exp / (s_fem @ s_fem))
    return lambda asked: np.full(len(asked), h)


def ridge(cells: Sequence[LengthCell]) -> Model:
    """Eq. 4 taken at its word: h = beta_0 + beta_1 x_1 + beta_2 x_2 + beta_3 x_3."""
    return _ridge(cells, condition_inputs)


def dimensionless_ridge(cells: Sequence[LengthCell]) -> Model:
    """Eq. 4 over strain, D/d and turns instead of lengths and pressures, one h per marker."""
    return _ridge(cells, dimensionless_inputs)


def _ridge(cells: Sequence[LengthCell], inputs_of: Inputs) -> Model:
    # Minimises Eq. 5, lengths over their root mean square, plus RIDGE_PENALTY times the squared
    # slopes, inputs standardised; the mean is not penalised.
    inputs = inputs_of(cells)
    s_fem, s_exp = lengths(cells)
    mean, spread = inputs.mean(axis=0), inputs.std(axis=0)
    scale = np.sqrt(np.mean(s_fem**2))

    def design(asked: Sequence[MarkerCondition]) -> Array:
        return np.column_stack([np.ones(len(asked)), (inputs_of(asked) - mean) / spread])

    rows = design(cells) * (s_fem / scale)[:, np.newaxis]
    penalty = RIDGE_PENALTY * np.diag([0.0, *np.ones(inputs.shape[1])])
    beta = np.linalg.solve(rows.T @ rows + penalty, rows.T @ (s_exp / scale))
    return lambda asked: np.asarray(design(asked) @ beta)


BASELINES: dict[str, Fit] = {
    "no correction": no_correction,
    "no stretch": no_stretch,
    "sigma/E": hooke_stretch,
    "constant factor": constant_factor,
    "ridge": ridge,
    "dimensionless ridge": dimensionless_ridge,
}
