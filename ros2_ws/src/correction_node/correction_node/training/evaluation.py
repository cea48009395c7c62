"""How good a model of h is: on cells it saw, on a case it did not see, beside plain rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from correction_node.models.dataset import (
    Array,
    Inputs,
    LengthCell,
    MarkerCondition,
    case_numbers,
    condition_inputs,
    dimensionless_inputs,
    lengths,
)
from winding_core.cable.cases import Material

Model = Callable[[Sequence[MarkerCondition]], Array]  # Predicts h, shape (n,)
# Learns a model from cells.
Fit = Callable[[Sequence[LengthCell]], Model]
RIDGE_PENALTY = 1.0


@dataclass(frozen=True, kw_only=True)
class Score:
    """Errors of one way of learning h, in Table 7's measure."""

    in_sample_pct: float  # Mean over all cells, learned from all cells
    # Mean over all cells, each predicted by a model that never saw its case.
    leave_one_case_out_pct: float
    worst_case_pct: float  # Largest mean of one left-out case
    in_sample: Array  # h by cell, shape (n,)
    held_out: Array  # h by cell, each from the model that left its case out, shape (n,)


def cell_errors_pct(cells: Sequence[LengthCell], h: Array) -> Array:
    """Return Table 8's error of each cell, shape (n,): 100 |S_EXP - h S_FEM| / (h S_FEM)."""
    s_fem, s_exp = lengths(cells)
    return np.asarray(100.0 * np.abs(s_exp - h * s_fem) / (h * s_fem))


def without_each_case(cells: Sequence[LengthCell]) -> list[list[LengthCell]]:
    """Return, for each case in order, the cells of all other cases."""
    return [
        [cell for cell in cells if cell.case != case] for case in np.unique(case_numbers(cells))
    ]


def hold_out(cells: Sequence[LengthCell], models: Sequence[Model]) -> Array:
    """Return h of each cell from the model that never saw its case, shape (n,).

    Args:
        cells: The measured cells.
        models: One learned from each of `without_each_case`, in this order.
    """
    cases = case_numbers(cells)
    h = np.empty(len(cells))
    for case, model in zip(np.unique(cases), models, strict=True):
        h[cases == case] = model([cell for cell in cells if cell.case == case])
    return h


def score(cells: Sequence[LengthCell], in_sample: Array, held_out: Array) -> Score:
    """Return the errors of h (cells,): learned from all cells, and with each case left out."""
    left_out = cell_errors_pct(cells, held_out)
    cases = case_numbers(cells)
    return Score(
        in_sample_pct=float(cell_errors_pct(cells, in_sample).mean()),
        leave_one_case_out_pct=float(left_out.mean()),
        worst_case_pct=float(max(left_out[cases == case].mean() for case in np.unique(cases))),
        in_sample=in_sample,
        held_out=held_out,
    )


def score_fit(cells: Sequence[LengthCell], fit: Fit) -> Score:
    """Return the errors of a way of learning h."""
    held_out = hold_out(cells, [fit(others) for others in without_each_case(cells)])
    return score(cells, fit(cells)(cells), held_out)


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
