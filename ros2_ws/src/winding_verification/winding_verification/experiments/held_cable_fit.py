"""A cable's six numbers from its training runs, by least squares."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from winding_verification.experiments.held_cable import HeldCable, predict
from winding_verification.experiments.scenario import ExternalFileError

# Of the training runs, and of their frames.
RUNS, FRAMES = 9, 400
ROUNDS = 8
# bending and viscosity as logarithms, drag, two natural curvatures, own
_START = np.array([math.log(0.03), math.log(0.1), 0.2, 0.0, 0.0, 0.5])
_LOWEST = np.array([math.log(1.0e-4), math.log(1.0e-3), 0.0, -15.0, -15.0, 0.0])
_HIGHEST = np.array([math.log(10.0), math.log(2.0), 20.0, 15.0, 15.0, 1.0])
# Forward differences must exceed what a whip of the cable makes of rounding.
_STEPS = np.array([0.03, 0.05, 0.05, 0.1, 0.1, 0.05])
_SCALE = 0.01  # [m] beyond which a residual counts linearly, not by its square
_LOST = 0.3  # [m] the residual of a run that diverges


def usual_gaps(runs: Sequence[FloatArray]) -> FloatArray:
    """Return the distances of neighbouring markers, median of all frames (markers - 1,) [m]."""
    gaps = [np.linalg.norm(np.diff(run, axis=1), axis=2) for run in runs]
    return np.asarray(np.median(np.concatenate(gaps), axis=0))


def fit(runs: Sequence[FloatArray], gaps: FloatArray) -> HeldCable:
    """Return the cable that explains some of the runs best.

    They are spread evenly over those in which no end is folded back: there two gripped markers
    were taken for one another.

    Args:
        runs: Training runs, each (frames, markers, 3) [m].
        gaps: Unstressed lengths between the markers [m].

    Raises:
        ExternalFileError: There is no run to fit on.
    """
    usable = [run for run in runs if not _folded(run)]
    if not usable:
        raise ExternalFileError("in every training run two gripped markers are exchanged")
    chosen = np.unique(np.linspace(0, len(usable) - 1, RUNS + 2)[1:-1].round().astype(int))
    some = [usable[i][:FRAMES] for i in chosen]

    def residuals(x: FloatArray) -> FloatArray:
        return np.concatenate([_residual(run, gaps, x) for run in some]) / _SCALE

    kept: dict[bytes, FloatArray] = {}

    def remembered(x: FloatArray) -> FloatArray:
        kept.clear()
        return kept.setdefault(x.tobytes(), residuals(x))

    def slopes(x: FloatArray) -> FloatArray:
        here = kept[x.tobytes()] if x.tobytes() in kept else residuals(x)
        columns = []
        for i, step in enumerate(_STEPS):
            moved = x.copy()
            moved[i] += step if x[i] + step <= _HIGHEST[i] else -step
            columns.append((residuals(moved) - here) / (moved[i] - x[i]))
        return np.stack(columns, axis=1)

    solved = least_squares(
        remembered,
        _START,
        jac=slopes,
        bounds=(_LOWEST, _HIGHEST),
        x_scale=10.0 * _STEPS,
        loss="soft_l1",
        max_nfev=ROUNDS,
    )
    return _cable(solved.x)


def _cable(x: FloatArray) -> HeldCable:
    return HeldCable(
        bending=math.exp(x[0]),
        viscosity=math.exp(x[1]),
        drag=float(x[2]),
        natural=(float(x[3]), float(x[4])),
        own=float(x[5]),
    )


def _residual(run: FloatArray, gaps: FloatArray, x: FloatArray) -> FloatArray:
    measured = run[2::4, 2:-2]
    try:
        return np.asarray((predict(run, gaps, _cable(x))[2::4, 2:-2] - measured).ravel())
    except DivergenceError:
        return np.full(measured.size, _LOST)


def _folded(run: FloatArray) -> bool:
    edges = np.diff(run, axis=1)
    turning = (edges[:, 1:] * edges[:, :-1]).sum(axis=2)
    return bool(turning[:, [0, -1]].min() < 0.0)
