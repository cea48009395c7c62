"""How good the law within a run is: P3 and P4 of every published run from its P1 and P2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from correction_node.live.within_run import FEWEST
from correction_node.models.dataset import Array, LengthCell
from winding_verification.correction.within_run_learning import (
    RunTable,
    conformal_quantile,
    expected_lengths,
    fit_build_up,
    held_out_lengths,
    run_scores,
    run_table,
)


@dataclass(frozen=True, kw_only=True)
class WithinRunCell:
    """One predicted marker."""

    case: int  # Row of Table 1
    marker: int  # n of Pn
    s_exp: float  # Measured [m]
    s: float  # Predicted with L_c from the other cases [m]
    half_width: float  # Of the interval around s, from the other cases [m]
    error_pct: float  # Table 7's measure, 100 |s_exp - s| / s

    @property
    def covered(self) -> bool:
        """Whether the measured length lies within the interval."""
        return abs(self.s_exp - self.s) <= self.half_width


@dataclass(frozen=True, kw_only=True)
class WithinRunScore:
    """The law within a run beside its plain rivals, in percent of the predicted length.

    Attributes:
        held_out_pct: Mean error over the cells, L_c from the other eleven cases: the honest one.
        rivals_pct: Mean error over the same cells of each plain rival, by name; nothing learned.
    """

    measured: int  # How many markers of each run are given, P1 first
    build_up_length: float  # L_c [m] from all cases
    in_sample_pct: float  # Mean error over the cells, L_c from all cases
    held_out_pct: float
    by_marker_pct: dict[int, float]  # The same by marker
    worst: WithinRunCell  # The held-out cell with the largest error
    coverage: float  # Share of the cells within their interval
    half_width_pct: float  # Mean half-width of the intervals
    rivals_pct: dict[str, float]
    cells: tuple[WithinRunCell, ...]  # Every held-out cell


def score_within_run(cells: Sequence[LengthCell], measured: int = FEWEST) -> WithinRunScore:
    """Return how well the markers after the first measured ones are predicted.

    Each cell is predicted with L_c from the other cases. Its interval is the largest score of
    those other cases, each predicted without itself; so the interval of a case has seen nothing
    of that case but its measured markers. The largest of eleven scores misses the twelfth case
    only when that one is the worst of all: on twelve cases the coverage cannot be far from
    11/12, whatever the law. How wide the interval must be for that is what tells laws apart.

    Args:
        cells: Measured cells with predictions; more than two cases.
        measured: How many markers of each run are given, at least two.

    Raises:
        ValueError: There is nothing to predict after that many markers.
    """
    runs = run_table(cells)
    if not FEWEST <= measured < runs.measured.shape[1]:
        raise ValueError(
            f"measured must lie in {FEWEST}..{runs.measured.shape[1] - 1}, got {measured}"
        )
    expected, ahead = held_out_lengths(runs, measured)
    widths = _held_out_bounds(runs, measured)[:, np.newaxis] * ahead
    held_out = tuple(
        WithinRunCell(
            case=runs.cases[row],
            marker=int(column) + 1,
            s_exp=float(runs.measured[row, column]),
            s=float(expected[row, column]),
            half_width=float(widths[row, column]),
            error_pct=float(_errors_pct(runs, expected)[row, column]),
        )
        for row, column in np.argwhere(np.isfinite(runs.measured) & np.isfinite(expected))
    )
    errors = _errors_pct(runs, expected)
    length = fit_build_up(runs)
    return WithinRunScore(
        measured=measured,
        build_up_length=length,
        in_sample_pct=_mean_pct(runs, expected_lengths(runs, length, measured)[0]),
        held_out_pct=_mean_pct(runs, expected),
        by_marker_pct={
            column + 1: float(np.nanmean(errors[:, column]))
            for column in range(measured, errors.shape[1])
        },
        worst=max(held_out, key=lambda cell: cell.error_pct),
        coverage=float(np.mean([cell.covered for cell in held_out])),
        half_width_pct=float(np.mean([100.0 * cell.half_width / cell.s for cell in held_out])),
        rivals_pct={
            "ratio of the last measured marker": _mean_pct(runs, _carried_ratio(runs, measured)),
            "last measured increment": _mean_pct(runs, _carried_increment(runs, measured)),
        },
        cells=held_out,
    )


def _held_out_bounds(runs: RunTable, measured: int) -> Array:
    """Return the bound over `ahead` for each run from the scores of all others, shape (m,)."""
    bounds = []
    for case in runs.cases:
        others = runs.without(case)
        scores = run_scores(others, *held_out_lengths(others, measured))
        bounds.append(conformal_quantile(scores))
    return np.array(bounds)


def _carried_ratio(runs: RunTable, measured: int) -> Array:
    """Return S_FEM_n S_k / S_FEM_k: the error of the last measured marker stays."""
    last = measured - 1
    ratio = runs.measured[:, last] / runs.predicted[:, last]
    return _after(runs.predicted * ratio[:, np.newaxis], measured)


def _carried_increment(runs: RunTable, measured: int) -> Array:
    """Return S_k + (n - k) (S_k - S_(k-1)): the last increment repeats, no solver is asked."""
    last = runs.measured[:, [measured - 1]]
    steps = np.arange(1, runs.measured.shape[1] + 1) - measured
    return _after(last + steps * (last - runs.measured[:, [measured - 2]]), measured)


def _after(lengths: Array, measured: int) -> Array:
    lengths = lengths.copy()
    lengths[:, :measured] = np.nan
    return lengths


def _errors_pct(runs: RunTable, expected: Array) -> Array:
    return np.asarray(100.0 * np.abs(runs.measured - expected) / expected)


def _mean_pct(runs: RunTable, expected: Array) -> float:
    return float(np.nanmean(_errors_pct(runs, expected)))
