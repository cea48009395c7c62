"""How good a model of h is: on the cells that it saw, and on the case that it did not see."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from correction_node.models.dataset import Array, LengthCell, MarkerCondition, case_numbers, lengths

# Predicts h, shape (n,).
Model = Callable[[Sequence[MarkerCondition]], Array]
# Learns a model from cells.
Fit = Callable[[Sequence[LengthCell]], Model]


@dataclass(frozen=True, kw_only=True)
class Score:
    """Errors of one way of learning h, in Table 7's measure.

    Attributes:
        in_sample_pct: Mean over all cells, learned from all cells.
        leave_one_case_out_pct: Mean over all cells, each predicted by a model that never saw
            its case: the honest one.
        worst_case_pct: Largest mean of one left-out case.
        in_sample: h by cell, shape (n,).
        held_out: h by cell, each from the model that left its case out, shape (n,).
    """

    in_sample_pct: float
    leave_one_case_out_pct: float
    worst_case_pct: float
    in_sample: Array
    held_out: Array


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
