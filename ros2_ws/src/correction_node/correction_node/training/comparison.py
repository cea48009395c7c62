"""Every model of h beside its plain rivals: in-sample, with each case left out, over seeds."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from correction_node.models.dataset import (
    Array,
    DataSet,
    LengthCell,
    MarkerCondition,
    case_numbers,
    dimensionless_inputs,
    lengths,
)
from correction_node.models.uncertainty import LEVEL, conformal_bound
from correction_node.training.evaluation import (
    BASELINES,
    Fit,
    Model,
    Score,
    cell_errors_pct,
    hold_out,
    score,
    score_fit,
    without_each_case,
)
from correction_node.training.protocol import learn_and_hold_out
from correction_node.training.training import LEARNERS, RIG, TrainingConfig

# Relative repeatability of a measured length, assumed: the paper's K-NN accuracy asks for it.
NOISE = 0.006
# Prior: h strays from the base by a tenth or so; a length scale is about one spread of an input.
_VARIANCE = 0.01
_VARIANCE_RANGE = (1.0e-5, 1.0)
_SCALE_RANGE = (0.3, 100.0)
BASELINE = "baseline"
LEARNED = "learned"
ORACLE = "oracle"
ONE_H_PER_CASE = "least squares, one h per case"
GAUSSIAN_PROCESS = "Gaussian process"
RIG_PROCESS = "rig Gaussian process"
SEEDS = (0, 1, 2)
Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class GaussianProcess:
    """ln(S / S_base) as a Gaussian process over the dimensionless inputs."""

    base: Model  # h of the base model
    regressor: GaussianProcessRegressor  # Fitted to standardised inputs
    mean: Array  # Of the training inputs, shape (k,)
    spread: Array  # Standard deviation of the training inputs, shape (k,)

    def h(self, conditions: Sequence[MarkerCondition]) -> Array:
        """Return h, shape (n,): the median."""
        return np.asarray(
            self.base(conditions) * np.exp(self.regressor.predict(self._scaled(conditions)))
        )

    def bounds(self, conditions: Sequence[MarkerCondition], level: float) -> tuple[Array, Array]:
        """Return (low, high) h between which a measured length lies with a probability.

        The process's own belief, noise of the measurement included; whether it is right, only
        left-out cases can show.
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
        # A scale at the end of its range: the input does not matter, or matters abruptly.
        warnings.simplefilter("ignore", ConvergenceWarning)
        regressor.fit((inputs - mean) / spread, np.log(s_exp / (base(cells) * s_fem)))
    return GaussianProcess(base=base, regressor=regressor, mean=mean, spread=spread)


@dataclass(frozen=True, kw_only=True)
class ModelScore(Score):
    """How good one way of learning h is: errors are means over seeds, h is of the first seed.

    What asks for left-out cases is NaN for an oracle.
    """

    kind: str  # ``baseline``, ``learned``, or ``oracle`` (knows the answer; a floor, not a model)
    description: str  # One sentence
    in_sample_spread_pct: float  # Largest minus smallest over seeds; 0 where nothing is random
    leave_one_case_out_spread_pct: float  # The same of the left-out error; NaN for an oracle
    # Conformal half-width at level 12/13, from the left-out residuals of the first seed; None for
    # an oracle.
    bound_pct: float | None = None
    # Share of left-out cells inside the model's own 90 % interval; None where it has none.
    own_interval_coverage_pct: float | None = None


def compare_models(
    data: DataSet,
    *,
    seeds: Sequence[int] = SEEDS,
    steps: int = TrainingConfig().steps,
    progress: Progress,
) -> dict[str, ModelScore]:
    """Return the score of every model, baselines and the floor, by name.

    Args:
        data: Measured cells with predictions.
        seeds: Of the models that start at random; the spread is over these.
        steps: Training steps of each network.
        progress: Called with one short sentence after each model.
    """
    cells = data.cells
    scores: dict[str, ModelScore] = {}

    def add(
        name: str,
        kind: str,
        description: str,
        seen: Sequence[Score],
        coverage_pct: float | None = None,
    ) -> None:
        scores[name] = _over_seeds(cells, seen, kind, description, coverage_pct)
        progress(f"scored '{name}'")

    for name, fit in BASELINES.items():
        add(name, BASELINE, _first_line(fit), [score_fit(cells, fit)])
    rigs: list[Model] = []
    for name, learner in LEARNERS.items():
        started = seeds if learner.seeded else seeds[:1]
        found = learn_and_hold_out(cells, learner, TrainingConfig(steps=steps), started)
        if name == RIG:
            rigs = [found[0].whole.h, *(model.h for model in found[0].left_out)]
        add(name, LEARNED, learner.description, [one.score for one in found])
    solver: list[Model] = [lambda asked: np.ones(len(asked))] * len(rigs)
    for name, bases, what in (
        (GAUSSIAN_PROCESS, solver, "the solver"),
        (RIG_PROCESS, rigs, "the rig's physics"),
    ):
        own, coverage_pct = _score_process(cells, bases)
        description = f"Gaussian process over dimensionless inputs on what {what} leaves over."
        add(name, LEARNED, description, [own], coverage_pct)
    scores[ONE_H_PER_CASE] = _oracle(cells)
    return scores


def _score_process(cells: Sequence[LengthCell], bases: Sequence[Model]) -> tuple[Score, float]:
    """Return errors of a process and the share of left-out cells [%] in its 90 % interval."""
    sets = [cells, *without_each_case(cells)]
    whole, *others = (learn_process(known, base) for known, base in zip(sets, bases, strict=True))
    own = score(cells, whole.h(cells), hold_out(cells, [process.h for process in others]))
    return own, 100.0 * _coverage(cells, others)


def _coverage(cells: Sequence[LengthCell], others: Sequence[GaussianProcess]) -> float:
    s_fem, s_exp = lengths(cells)

    def end(process: GaussianProcess, which: int) -> Model:
        return lambda asked: process.bounds(asked, LEVEL)[which]

    low, high = (hold_out(cells, [end(process, which) for process in others]) for which in (0, 1))
    h = s_exp / s_fem
    return float(np.mean((low <= h) & (h <= high)))


def _over_seeds(
    cells: Sequence[LengthCell],
    scores: Sequence[Score],
    kind: str,
    description: str,
    coverage_pct: float | None,
) -> ModelScore:
    seen = [score.in_sample_pct for score in scores]
    unseen = [score.leave_one_case_out_pct for score in scores]
    return ModelScore(
        kind=kind,
        description=description,
        in_sample_pct=float(np.mean(seen)),
        leave_one_case_out_pct=float(np.mean(unseen)),
        worst_case_pct=float(np.mean([score.worst_case_pct for score in scores])),
        in_sample_spread_pct=max(seen) - min(seen),
        leave_one_case_out_spread_pct=max(unseen) - min(unseen),
        in_sample=scores[0].in_sample,
        held_out=scores[0].held_out,
        bound_pct=100.0 * conformal_bound(cells, scores[0].held_out).relative,
        own_interval_coverage_pct=coverage_pct,
    )


def _oracle(cells: Sequence[LengthCell]) -> ModelScore:
    s_fem, s_exp = lengths(cells)
    cases = case_numbers(cells)
    h = np.empty(len(cells))
    for case in np.unique(cases):
        mine = cases == case
        h[mine] = (s_fem[mine] @ s_exp[mine]) / (s_fem[mine] @ s_fem[mine])
    return ModelScore(
        kind=ORACLE,
        description="The minimum of Eq. 5 if every case had its own h: no network can do better.",
        in_sample_pct=float(cell_errors_pct(cells, h).mean()),
        leave_one_case_out_pct=math.nan,
        worst_case_pct=math.nan,
        in_sample_spread_pct=0.0,
        leave_one_case_out_spread_pct=math.nan,
        in_sample=h,
        held_out=np.full(len(cells), math.nan),
    )


def _first_line(fit: Fit) -> str:
    return (fit.__doc__ or "").splitlines()[0]
