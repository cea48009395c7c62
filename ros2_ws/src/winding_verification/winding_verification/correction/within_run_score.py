"""The law within a run: what runs teach of it, and how good it is on the published ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from correction_node.live.within_run import FEWEST, WithinRun
from correction_node.models.dataset import Array, LengthCell, case_numbers

LEVEL = 0.9
# Search range of L_c [m]: from "grown out after one spacing" to "still growing at the end".
_SHORTEST, _LONGEST = 0.01, 1.0
_RESOLUTION = 1.0e-4  # A millimetre in L_c moves no length by more than 0.01 %


@dataclass(frozen=True, kw_only=True)
class RunTable:
    """Runs as arrays: rows are cases, columns are P1, P2, ..."""

    cases: tuple[int, ...]  # Row of Table 1, shape (m,)
    spacing: Array  # Marker spacing [m], shape (m,)
    predicted: Array  # S_FEM [m], shape (m, n)
    measured: Array  # S_EXP [m], shape (m, n); NaN where the paper measured none

    def without(self, case: int) -> RunTable:
        """Return the table without one case."""
        keep = [row for row, number in enumerate(self.cases) if number != case]
        return RunTable(
            cases=tuple(self.cases[row] for row in keep),
            spacing=self.spacing[keep],
            predicted=self.predicted[keep],
            measured=self.measured[keep],
        )


def run_table(cells: Sequence[LengthCell]) -> RunTable:
    """Return measured cells as a table of runs."""
    cases = tuple(int(case) for case in np.unique(case_numbers(cells)))
    shape = (len(cases), max(cell.marker for cell in cells))
    predicted, measured = np.full(shape, np.nan), np.full(shape, np.nan)
    spacing = np.empty(len(cases))
    for cell in cells:
        row = cases.index(cell.case)
        predicted[row, cell.marker - 1] = cell.s_fem
        measured[row, cell.marker - 1] = cell.s_exp
        spacing[row] = cell.original_length / cell.marker
    return RunTable(cases=cases, spacing=spacing, predicted=predicted, measured=measured)


def expected_lengths(runs: RunTable, build_up_length: float, measured: int) -> tuple[Array, Array]:
    """Return (expected S, distance ahead) [m] of what follows the first measured markers.

    Args:
        runs: The runs; of each only P1 .. P`measured` are looked at.
        build_up_length: L_c [m].
        measured: How many markers are given.

    Returns:
        Two arrays of the table's shape; NaN at given markers and where nothing is predicted.
    """
    law = WithinRun(build_up_length=build_up_length)
    s = np.full(runs.measured.shape, np.nan)
    ahead = np.full(runs.measured.shape, np.nan)
    for row, spacing in enumerate(runs.spacing):
        for column in range(measured, len(s[row])):
            found = law.length_ahead(
                column + 1,
                spacing=float(spacing),
                predicted=runs.predicted[row],
                measured=runs.measured[row, :measured],
            )
            if found is not None:
                s[row, column], ahead[row, column] = found.s, found.ahead
    return s, ahead


def fit_build_up(runs: RunTable) -> float:
    """Return L_c [m]: least squares of the relative errors of P3, P4, ... from P1 and P2."""

    def loss(length: float) -> float:
        expected, _ = expected_lengths(runs, length, FEWEST)
        return float(np.nansum((runs.measured / expected - 1.0) ** 2))

    found = minimize_scalar(
        loss, bounds=(_SHORTEST, _LONGEST), method="bounded", options={"xatol": _RESOLUTION}
    )
    return float(found.x)


def held_out_lengths(runs: RunTable, measured: int) -> tuple[Array, Array]:
    """Return `expected_lengths` of each run with L_c from all other runs."""
    s = np.full(runs.measured.shape, np.nan)
    ahead = np.full(runs.measured.shape, np.nan)
    for row, case in enumerate(runs.cases):
        length = fit_build_up(runs.without(case))
        one, far = expected_lengths(runs, length, measured)
        s[row], ahead[row] = one[row], far[row]
    return s, ahead


def run_scores(runs: RunTable, expected: Array, ahead: Array) -> Array:
    """Return the largest |S - expected| / ahead of each run, shape (m,); NaN without a cell.

    The error grows with the distance that is extrapolated, so this is what is comparable between
    markers; the largest of a run, because the markers of one cable are not independent.
    """
    off = np.abs(runs.measured - expected) / ahead
    scores = np.full(len(off), np.nan)
    some = np.isfinite(off).any(axis=1)
    scores[some] = np.nanmax(off[some], axis=1)
    return scores


def conformal_quantile(scores: Array, level: float = LEVEL) -> float:
    """Return the ceil((n + 1) level)-th smallest of n scores; the largest when n is too small.

    It covers the next exchangeable score with probability `level`; with n < 9 and the level 0.9
    only n / (n + 1) is promised.
    """
    ranked = np.sort(scores[np.isfinite(scores)])
    return float(ranked[min(math.ceil((len(ranked) + 1) * level), len(ranked)) - 1])


def learn_within_run(cells: Sequence[LengthCell]) -> WithinRun:
    """Return L_c from all runs, and bounds from runs that were left out of it.

    Of five forms with at most one number to learn, each fitted to absolute and to squared errors,
    this one had the smallest left-out error on the paper's runs (the others: 0.52 to 0.58 %
    where this has 0.48 %), so that error is a little optimistic; all of them beat both rivals.

    Args:
        cells: Measured cells with predictions whose increments are about even: this project's
            rod. The first marker of the paper's own simulation is off by up to 37 % in two
            cases, which no increment survives.
    """
    runs = run_table(cells)
    given = range(FEWEST, runs.measured.shape[1])
    return WithinRun(
        build_up_length=fit_build_up(runs),
        relative_bounds=tuple(
            conformal_quantile(run_scores(runs, *held_out_lengths(runs, count))) for count in given
        ),
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
    """The law within a run beside its plain rivals, in percent of the predicted length."""

    measured: int  # How many markers of each run are given, P1 first
    build_up_length: float  # L_c [m] from all cases
    in_sample_pct: float  # Mean error over the cells, L_c from all cases
    held_out_pct: float  # Mean error over the cells, L_c from the other eleven cases
    by_marker_pct: dict[int, float]  # The same by marker
    worst: WithinRunCell  # The held-out cell with the largest error
    coverage: float  # Share of the cells within their interval
    half_width_pct: float  # Mean half-width of the intervals
    # Mean error over the same cells of each plain rival, by name; nothing learned.
    rivals_pct: dict[str, float]
    cells: tuple[WithinRunCell, ...]  # Every held-out cell


def score_within_run(cells: Sequence[LengthCell], measured: int = FEWEST) -> WithinRunScore:
    """Return how well the markers after the first measured ones are predicted.

    Each cell is predicted with L_c from the other cases. Its interval is the largest score of
    those other cases, each predicted without itself; so the interval of a case has seen nothing
    of that case but its measured markers. The largest of eleven scores misses the twelfth case
    only when that one is the worst of all: on twelve cases the coverage cannot be far from
    11/12, whatever the law. Laws differ in how wide the interval must be for that.

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
