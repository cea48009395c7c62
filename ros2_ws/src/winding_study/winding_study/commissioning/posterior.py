"""The posterior of a cell's numbers: one least squares over a run, its draws, what it determines.

The closed form gives the way; what the rod adds is found at the optimum, with its slopes, and added
until that stands still, as in `cable_fem_node.identification.search`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.identification import IdentificationError, Readings
from cable_fem_node.identification.levenberg import optimum, student
from cable_fem_node.identification.rig_posterior import Belief, covariance_of
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.run_inputs import Inputs
from winding_study.commissioning.lay import CellLay, Places
from winding_study.commissioning.motion import Motion
from winding_study.commissioning.unknowns import (
    COUNT,
    Array,
    CellPrior,
    Coordinates,
    Numbers,
    Unknown,
)

# Of angles relative to themselves and as an offset [rad], of z relative and as an offset [m]: what
# the closed form, corrected by the rod, still misses where the numbers are others than the rod's.
ANGLE_SHARE, ANGLE_OFFSET = 1.0e-4, 0.5e-3
Z_SHARE, Z_OFFSET = 0.3e-3, 0.05e-3
# Of an element's angle times the change of the stretch where cable slips; of an element's advance,
# and the angle [rad] over which that is forgotten. Rods of 0.8 times the element, 2 cells.
SLIP_SHARE, START_SHARE, START_ANGLE = 0.5, 0.2, 8.0
_PROBE = 1.0e-3
# The rod is wound at so many optima at most; its slopes are found at this one. Its elements are
# seen in steps that are shorter.
_STEPS, _ROD_CALLS, _FIRST, _ROD_STEPS = 40, 5, 1, (0.1, 0.5)
_LEAST_GAIN = 1.0e-3
_EXACT = ("load_share", "eye", "camera_scale")
# The search ends where the rod moves it by less than this share of a deviation.
_SETTLED = 0.2
_FREEDOM = 12.0
_ROUNDS = 4
DRAWS = 1500
# A misfit that chance reaches more rarely widens all intervals.
_MISFIT = 0.01


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One run to learn from."""

    config: WindingConfig  # As configured
    inputs: Inputs  # Measured motion, with the pull at the guide [N]
    motion: Motion  # That was commanded
    readings: Readings  # Where markers lie


@dataclass(frozen=True, kw_only=True)
class Found(Belief):
    """One number, before and after the run."""

    name: str  # As in every table of numbers
    words: str  # What it is, with its printed unit
    unit: float  # One of these in SI
    prior_low: float  # 5 % of the prior lie below
    prior_high: float  # 5 % lie above


@dataclass(frozen=True, kw_only=True)
class CellPosterior:
    """What a run determines of a cell.

    Attributes:
        draws: Numbers by name, shape (n,) each, with `weights`, which sum to one.
        best: Numbers at the optimum, shape (1,) each.
        deviates: Of the prior there, shape (COUNT,).
        covariance: Of the deviates, shape (COUNT, COUNT).
        found: What was looked for, and combinations that do not depend on what hides behind what.
    """

    unknowns: tuple[Unknown, ...]  # In the order of the deviates
    draws: dict[str, Array]
    weights: Array
    best: Numbers
    deviates: Array
    covariance: Array
    found: tuple[Found, ...]
    chi_square: float  # Of the residuals, prior included
    measured: int  # How many numbers were measured
    misfit: float  # Factor by which all deviations were widened, 1 for none
    rod_calls: int  # How often the rod was wound

    @property
    def effective(self) -> float:
        """How many independent draws the weighted ones are worth."""
        return 1.0 / float(self.weights @ self.weights)

    @property
    def unobservable(self) -> tuple[str, ...]:
        """Numbers that the run does not narrow."""
        return tuple(item.name for item in self.found if not item.observed)

    def of(self, name: str) -> Found:
        """Return one number."""
        return next(item for item in self.found if item.name == name)


class Whitened:
    """Residuals of one run's markers, standard normal each, for many cells at once.

    What the rod adds to the closed form is a line in the coordinates of the search: known at one
    cell, with its slopes by forward differences of the rod.

    Args:
        lay: The closed form of the run's motion.
        readings: Where markers lie.
        coordinates: Of the search.
        u: Where it begins, shape (COUNT,).
    """

    def __init__(
        self, lay: CellLay, readings: Readings, coordinates: Coordinates, u: Array
    ) -> None:
        self._lay, self._used = lay, readings.ids - 1
        self._coordinates, self._readings = coordinates, readings
        self.measured = np.concatenate([readings.theta, readings.z])
        self.white = whitening(readings, lay, coordinates.numbers(u[None]))
        self._at, self._excess = u, np.zeros(self.measured.size)
        self._slopes = np.zeros((COUNT, self.measured.size))
        self.rod_calls = 0

    def predicted(self, places: Places) -> Array:
        """Return theta and z of the used markers, shape (n, 2 m); one that never lands is far."""
        rows = np.hstack([places.theta[:, self._used], places.z[:, self._used]])
        count = self._used.size
        far = np.concatenate([np.full(count, 2.0 * self._lay.end), np.zeros(count)])
        return np.where(np.isnan(rows), far, rows)

    def residuals(self, u: Array, numbers: Numbers) -> Array:
        """Return residuals, shape (n, 2 m), at coordinates, shape (n, COUNT)."""
        off = self.predicted(self._lay(numbers)) + self._excess - self.measured
        return np.asarray((off + (u - self._at) @ self._slopes) @ self.white.T)

    def learn_excess(self, u: Array) -> None:
        """Find what the rod adds to the closed form at one cell, coordinates of shape (COUNT,).

        Raises:
            SolverError, ValueError: The rod fails.
            IdentificationError: A used marker does not land on it.
        """
        self._excess, self._at = self._added(u), u
        numbers = self._coordinates.numbers(u[None])
        self.white = whitening(self._readings, self._lay, numbers)

    def learn_slopes(self, deviations: Array) -> None:
        """Find how that changes along every coordinate, over about a deviation of each, (COUNT,).

        Raises:
            SolverError, ValueError: The rod fails.
            IdentificationError: A used marker does not land on it.
        """
        for k, item in enumerate(self._coordinates.unknowns):
            # The load share alone changes nothing, see `Coordinates`; eye and camera are exact.
            if item.known or item.name in _EXACT:
                continue
            step = float(np.clip(deviations[k], *_ROD_STEPS))
            aside = self._at.copy()
            aside[k] += step if aside[k] < 0.0 else -step
            self._slopes[k] = (self._added(aside) - self._excess) / (aside[k] - self._at[k])

    def _added(self, u: Array) -> Array:
        numbers = self._coordinates.numbers(u[None])
        plain = {**numbers, "eye": np.zeros(1), "camera_scale": np.zeros(1)}
        rod, closed = self._lay.rod(plain), self._lay(plain)
        self.rod_calls += 1
        if not np.isfinite(rod.theta + closed.theta)[:, self._used].all():
            raise IdentificationError("a used marker does not land on the rod")
        found: Array = (self.predicted(rod) - self.predicted(closed))[0]
        return found


def whitening(readings: Readings, lay: CellLay, numbers: Numbers) -> Array:
    """Return what makes residuals of angles and z standard normal, shape (2 m, 2 m).

    Elements of the rod have a length, a cable has none: where a slip ends, and where the first
    element lands, the rod knows to a part of an element.

    Args:
        readings: Where markers lie, and how well they are measured.
        lay: Of the run.
        numbers: Of the cell about which it holds, shape (1,) each.
    """
    theta, z, count = readings.theta, readings.z, readings.ids.size
    covariance = np.zeros((2 * count, 2 * count))
    of_theta = np.diag(readings.sigma_theta**2 + ANGLE_OFFSET**2)
    of_theta += ANGLE_SHARE**2 * np.outer(theta, theta) + ANGLE_OFFSET**2
    for angle, change in lay.slips(numbers):
        behind = (theta > angle) * (SLIP_SHARE * lay.element * change)
        of_theta += np.outer(behind, behind)
    start = START_SHARE * lay.element * abs(lay.advance) * np.exp(-theta / START_ANGLE)
    covariance[:count, :count] = of_theta
    covariance[count:, count:] = (
        np.diag(readings.sigma_z**2 + Z_OFFSET**2)
        + Z_SHARE**2 * np.outer(z, z)
        + Z_OFFSET**2
        + np.outer(start, start)
    )
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))


def identify_cell(
    run: Measured, prior: CellPrior | None = None, draws: int = DRAWS
) -> CellPosterior:
    """Return the posterior of a cell's numbers from one run.

    Raises:
        IdentificationError: The markers fit no cell of the prior, or the rod cannot wind it.
    """
    from scipy.special import chdtrc  # noqa: PLC0415 - a plan without a fit needs none

    prior = CellPrior() if prior is None else prior
    lay = CellLay(run.config, run.inputs, run.motion)
    unknowns = prior.unknowns(run.config)
    coordinates = Coordinates(
        unknowns=unknowns,
        pull=lay.mean_pull,
        area=run.config.case.axial_area,
        wound=lay.wound,
    )
    u = coordinates.start()
    markers = Whitened(lay, run.readings, coordinates, u)
    information, cost = np.eye(COUNT), math.inf
    try:
        for attempt in range(_ROD_CALLS + 1):
            before = u
            (u,), (information,), (cost,) = optimum(
                lambda places: _residuals(markers, coordinates, places[0])[0][None],
                u[None],
                probe=_PROBE,
                steps=_STEPS,
                settled=_LEAST_GAIN,
            )
            moved = before - u
            if attempt > _FIRST and float(moved @ information @ moved) < _SETTLED**2 * COUNT:
                break
            if attempt < _ROD_CALLS:
                markers.learn_excess(u)
            if attempt == _FIRST:
                markers.learn_slopes(np.sqrt(np.diag(np.linalg.inv(information))))
    except (SolverError, ValueError) as error:
        raise IdentificationError(f"the rod cannot wind the best cell: {error}") from error
    measured = markers.measured.size
    squares = 2.0 * float(cost)
    misfit = 1.0
    if float(chdtrc(measured, squares)) < _MISFIT:
        misfit = math.sqrt(squares / measured)
        information = information / misfit**2
    sample, weights = _drawn(markers, coordinates, u, information, misfit, draws)
    numbers = coordinates.numbers(sample)
    return CellPosterior(
        unknowns=unknowns,
        draws=numbers,
        weights=weights,
        best=coordinates.numbers(u[None]),
        deviates=coordinates.deviates(u[None])[0],
        covariance=covariance_of(coordinates.deviates(sample), weights),
        found=tuple(_found(unknowns, numbers, weights)),
        chi_square=squares,
        measured=measured,
        misfit=misfit,
        rod_calls=markers.rod_calls,
    )


def _residuals(markers: Whitened, coordinates: Coordinates, u: Array) -> tuple[Array, Array]:
    """Return residuals of markers and prior, and what else ln of the prior density has."""
    numbers = coordinates.numbers(u)
    prior, more = coordinates.prior(u, numbers)
    return np.hstack([markers.residuals(u, numbers), prior]), more


def _drawn(
    markers: Whitened,
    coordinates: Coordinates,
    u: Array,
    information: Array,
    misfit: float,
    count: int,
) -> tuple[Array, Array]:
    """Return draws from a t distribution and their weights, which sum to one.

    Mean and spread of the proposal are those of the draws before, beginning with the optimum
    (population Monte Carlo, Cappe et al., J. Comput. Graph. Stat. 13, 2004). Weights are cut at
    the root of the number of draws (Ionides, J. Comput. Graph. Stat. 17, 2008).
    """
    rng = np.random.default_rng(0)
    middle, covariance = u, np.linalg.inv(information)
    for last in (*(False,) * _ROUNDS, True):
        drawn, proposed = student(rng, count, COUNT, _FREEDOM)
        sample = middle + drawn @ np.linalg.cholesky(covariance).T
        rows, more = _residuals(markers, coordinates, sample)
        fit = (rows[:, :-COUNT] ** 2).sum(axis=1) / misfit**2 + (rows[:, -COUNT:] ** 2).sum(axis=1)
        weight = more - 0.5 * fit - proposed
        weight = np.exp(weight - weight.max())
        weight = np.minimum(weight, weight.mean() * math.sqrt(count))
        weight /= weight.sum()
        if not last:
            middle, seen = weight @ sample, covariance_of(sample, weight)
            # Few draws that count leave a covariance of low rank: the one before fills it up.
            trusted = min(1.0, 1.0 / float(weight @ weight) / (5.0 * COUNT))
            covariance = trusted * seen + (1.0 - trusted) * covariance
    return sample, weight


def _found(unknowns: tuple[Unknown, ...], numbers: dict[str, Array], weights: Array) -> list[Found]:
    rng = np.random.default_rng(1)
    before = {item.name: item.value(rng.standard_normal(4000)) for item in unknowns}
    rows = [
        (item.name, item.words, item.unit) for item in unknowns if item.asked and not item.known
    ]
    # Of pull, modulus and drag markers determine the ratios alone.
    for table in (numbers, before):
        table["young_per_share"] = table["young"] / table["load_share"]
        table["drag_per_share"] = table["guide_drag"] / table["load_share"]
    rows += [
        ("young_per_share", "E over load share, MPa", 1.0e6),
        ("drag_per_share", "drag over load share, N", 1.0),
    ]
    made = []
    for name, words, unit in rows:
        prior = before[name]
        prior_low, prior_high = np.quantile(prior, [0.05, 0.95])
        made.append(
            Found(
                **vars(Belief.of(numbers[name], weights, float(prior.std()))),
                name=name,
                words=words,
                unit=unit,
                prior_low=float(prior_low),
                prior_high=float(prior_high),
            )
        )
    return made
