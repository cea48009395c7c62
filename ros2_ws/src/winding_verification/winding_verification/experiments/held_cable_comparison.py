"""DEFORM's cables: fitted on their training runs, judged by its loss on the held-out ones."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import least_squares

from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from winding_verification.experiments.external_row import ExternalRow
from winding_verification.experiments.held_cable import HeldCable, loss, predict
from winding_verification.experiments.motion_capture import FRAME_TIME, CapturedCable
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


NAME = "deform"
# Every cable stays below this many times its published figure, half of them below the figure.
_MOST = 1.5


class HeldCableComparison:
    """Cables one after the other, then how many of them reach what was published."""

    def __init__(self) -> None:
        self._reached: list[bool] = []

    def compare(self, runs: CapturedCable) -> Iterator[ExternalRow]:
        """Fit a cable on its training runs; yield its error on the held-out ones.

        Raises:
            ExternalFileError: There is no run to fit on.
            SolverError: A run diverges with the fitted cable.
        """
        gaps = usual_gaps(runs.train)
        cable = fit(runs.train, gaps)
        losses = []
        begun = time.process_time()
        for number, run in enumerate(runs.held_out, 1):
            try:
                losses.append(loss(predict(run, gaps, cable), run))
            except DivergenceError as error:
                raise DivergenceError(f"{runs.name}, held-out run {number}: {error}") from error
        spent = time.process_time() - begun
        simulated = sum(run.shape[0] - 2 for run in runs.held_out) * FRAME_TIME
        mean = float(np.mean(losses))
        if runs.published is not None:
            self._reached.append(mean <= runs.published)
        yield ExternalRow(
            experiment=NAME,
            variant=f"{runs.name}, {len(losses)} runs held out; {_described(cable)}",
            quantity="coordinate_error",
            computed=mean,
            bar=None if runs.published is None else _MOST * runs.published,
            published={} if runs.published is None else {"DEFORM": runs.published},
        )
        yield ExternalRow(
            experiment=NAME,
            variant=runs.name,
            quantity="processor_time_per_time",
            computed=spent / simulated,
        )

    def reached(self) -> Iterator[ExternalRow]:
        """Yield the share of the cables whose error is at most the published one."""
        if self._reached:
            yield ExternalRow(
                experiment=NAME,
                variant=f"{len(self._reached)} cables with a published figure",
                quantity="share_at_most_published",
                computed=float(np.mean(self._reached)),
                bar=0.5,
                at_least=True,
            )


def _described(cable: HeldCable) -> str:
    first, second = cable.natural
    return (
        f"EI by mass {cable.bending:.3g}, viscosity {cable.viscosity:.3g}, drag {cable.drag:.2g}, "
        f"natural {first:.2g} {second:.2g}, own {cable.own:.2g}"
    )
