"""A control chart that needs no known level: it announces that a quantity drifts over runs.

Self-starting CUSUM (Hawkins 1987, Journal of Quality Technology 19; Hawkins and Olwell 1998,
chapter 7). Each value is held against all before it since the last announcement,

    t = (x - mean) / (s sqrt(1 + 1 / m)),    u = Phi^-1(F_nu(t)),
    C+ = max(0, C+ + u - k),    C- = max(0, C- - u - k),    announced above h.

u is standard normal while nothing changes, whatever level and scatter are, so that the average
run length is that of a CUSUM whose level is known. s is taken from successive differences (von
Neumann et al. 1941), s^2 = sum (x_i - x_{i-1})^2 / (2 (m - 1)), with nu = 2 (m - 1)^2 / (3 m - 4)
degrees of freedom: a drift that goes on from the first run does not hide in its own scatter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri, stdtr

# Half a standard deviation is what is to be found at least; with this limit there is a false
# announcement in 760 stable runs, in both directions together (`tests/winding_reports`).
ALLOWANCE, LIMIT = 0.5, 5.5
AVERAGE_RUN_LENGTH = 760
# So many values state a level before the next one is judged.
FIRST = 4
# Beyond these a normal deviate is saturated.
_LARGEST = 8.0
_SIGMAS = 3.0
_SLOPE_VALUES = 10
# Less than this share of the level is round-off and no scatter.
_ROUND_OFF = 1.0e-6


@dataclass(frozen=True, kw_only=True)
class Drift:
    """An announced change of level."""

    begin: int  # First value of the chart that announces it
    since: int  # First value that belongs to the change
    at: int  # Value with which it is announced
    up: bool  # Whether values grow
    level: float  # Mean before the change
    now: float  # Mean since the change
    pace: float  # Change per value, by least squares over it, ten values at least


@dataclass(frozen=True, kw_only=True)
class DriftChart:
    """A chart of values in their order, shape (n,); nan where a value is not judged yet."""

    values: NDArray[np.float64]
    centre: NDArray[np.float64]  # Mean of what a value is held against
    low: NDArray[np.float64]  # Three standard deviations below
    high: NDArray[np.float64]  # Three standard deviations above
    upward: NDArray[np.float64]  # C+
    downward: NDArray[np.float64]  # C-
    drifts: tuple[Drift, ...]  # In the order of their announcements


def drift_chart(values: ArrayLike, *, falls: bool = True) -> DriftChart:
    """Return the chart of values in their order, shape (n,).

    Args:
        values: Finite.
        falls: Whether a fall is announced, too, and not a rise alone.

    Raises:
        ValueError: A value is not finite.
    """
    x = np.asarray(values, dtype=float)
    if x.ndim != 1 or not np.isfinite(x).all():
        raise ValueError(f"a chart needs finite values in a row, got shape {x.shape}")
    rows = np.full((5, len(x)), np.nan)
    drifts: list[Drift] = []
    begin = 0
    while begin < len(x):
        begin = _piece(x.tolist(), begin, rows, drifts, falls)
    return DriftChart(
        values=x,
        centre=rows[0],
        low=rows[1],
        high=rows[2],
        upward=rows[3],
        downward=rows[4],
        drifts=tuple(drifts),
    )


def _piece(
    x: list[float], begin: int, rows: NDArray[np.float64], drifts: list[Drift], falls: bool
) -> int:
    """Chart values up to an announcement; return the first of the next piece."""
    # Of the values before the present one, less the first: that loses no digits.
    total, squares, count = 0.0, 0.0, 1
    up = down = 0.0
    since = {True: begin + FIRST, False: begin + FIRST}
    for i in range(begin + 1, len(x)):
        mean = x[begin] + total / count
        if count >= FIRST:
            scatter = max(math.sqrt(squares / (2.0 * (count - 1))), _ROUND_OFF * abs(mean))
            sigma = scatter * math.sqrt(1.0 + 1.0 / count)
            u = _deviate(x[i] - mean, sigma, count)
            up, down = max(0.0, up + u - ALLOWANCE), falls * max(0.0, down - u - ALLOWANCE)
            rows[:, i] = (mean, mean - _SIGMAS * sigma, mean + _SIGMAS * sigma, up, down)
            if max(up, down) > LIMIT:
                upward = up > down
                drifts.append(_drift(x, begin, since[upward], i, upward))
                return i + 1
            if up == 0.0:
                since[True] = i + 1
            if down == 0.0:
                since[False] = i + 1
        total += x[i] - x[begin]
        squares += (x[i] - x[i - 1]) ** 2
        count += 1
    return len(x)


def _deviate(off: float, sigma: float, count: int) -> float:
    """Return the normal deviate that is as unlikely as a value so far off."""
    if off == 0.0:
        return 0.0
    if sigma == 0.0:
        return math.copysign(_LARGEST, off)
    freedom = 2.0 * (count - 1) ** 2 / (3 * count - 4)
    # The lower tail keeps its digits.
    deviate = float(ndtri(stdtr(freedom, -abs(off) / sigma)))
    return math.copysign(min(-deviate, _LARGEST), off)


def _drift(x: Sequence[float], begin: int, since: int, at: int, up: bool) -> Drift:
    # Fewer values have a slope of scatter alone.
    first = max(begin, min(since, at + 1 - _SLOPE_VALUES))
    pace = float(np.polyfit(np.arange(at + 1 - first), x[first : at + 1], 1)[0])
    return Drift(
        begin=begin,
        since=since,
        at=at,
        up=up,
        level=fmean(x[begin:since]),
        now=fmean(x[since : at + 1]),
        pace=pace,
    )
