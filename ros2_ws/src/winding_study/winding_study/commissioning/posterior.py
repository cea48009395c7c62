"""The posterior of a cell's numbers: one least squares over a run, its draws, what it determines.

The closed form gives way and slope; what the rod adds is found at the optimum and added to it until
that stands still, as in `cable_fem_node.identification.search`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.identification import IdentificationError, Readings
from cable_fem_node.identification.rig_posterior import interval_of
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.run_inputs import Inputs
from winding_study.commissioning.lay import CellLay, Places
from winding_study.commissioning.unknowns import COUNT, Array, CellPrior, Coordinates, Unknown

# Of angles relative to themselves and as an offset [rad], of z relative and as an offset [m]: what
# the closed form, corrected by the rod, still misses where the numbers are others than the rod's.
ANGLE_SHARE, ANGLE_OFFSET = 3.0e-4, 0.4e-3
Z_SHARE, Z_OFFSET = 1.0e-3, 0.03e-3
_PROBE = 1.0e-3
_STEPS, _ROD_CALLS = 40, 4
# The search ends where the rod moves it by less than this share of a deviation.
_SETTLED = 0.2
_FREEDOM = 6.0
DRAWS = 1500
# A number whose deviation stays above this share of the prior's is unobservable.
_OBSERVED = 0.8
# A misfit that chance reaches more rarely widens all intervals.
_MISFIT = 0.01


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One run to learn from."""

    config: WindingConfig  # As configured
    inputs: Inputs  # Motion, with the pull at the guide [N]
    readings: Readings  # Where markers lie


@dataclass(frozen=True, kw_only=True)
class Found:
    """One number, before and after the run."""

    name: str
    words: str
    unit: float
    mean: float
    deviation: float
    low: float  # 5 % of the posterior lie below
    high: float  # 5 % lie above
    prior_low: float  # 5 % of the prior lie below
    prior_high: float
    prior_deviation: float

    @property
    def half_width_90(self) -> float:
        """Half of the 90 % interval."""
        return 0.5 * (self.high - self.low)

    @property
    def observed(self) -> bool:
        """Whether the run narrows the prior."""
        return self.deviation < _OBSERVED * self.prior_deviation


@dataclass(frozen=True, kw_only=True)
class CellPosterior:
    """What a run says of a cell.

    Attributes:
        draws: Numbers by name, shape (n,) each, with `weights`, which sum to one.
        best: Deviates at the optimum, shape (COUNT,).
        covariance: Of the deviates, shape (COUNT, COUNT).
        found: What was looked for, and combinations that do not depend on what hides behind what.
    """

    unknowns: tuple[Unknown, ...]
    draws: dict[str, Array]
    weights: Array
    best: Array
    covariance: Array
    found: tuple[Found, ...]
    chi_square: float  # Of the residuals, prior included
    measured: int  # How many numbers were measured
    misfit: float  # Factor by which all deviations were widened, 1 for none
    rod_calls: int

    @property
    def unobservable(self) -> tuple[str, ...]:
        """Numbers that the run does not narrow."""
        return tuple(item.name for item in self.found if not item.observed)

    def of(self, name: str) -> Found:
        """Return one number."""
        return next(item for item in self.found if item.name == name)

    def mean_numbers(self) -> dict[str, Array]:
        """Return the best cell, shape (1,) of each number; its covariance is about this place."""
        return {
            item.name: np.atleast_1d(item.value(self.best[k : k + 1]))
            for k, item in enumerate(self.unknowns)
        }


class Whitened:
    """Residuals of one run's markers, standard normal each, for many cells at once.

    Args:
        lay: The closed form of the run's motion.
        readings: Where markers lie.
    """

    def __init__(self, lay: CellLay, readings: Readings) -> None:
        self._lay, self._used = lay, readings.ids - 1
        self.measured = np.concatenate([readings.theta, readings.z])
        self.white = whitening(readings)
        self.excess = np.zeros(self.measured.size)

    def predicted(self, places: Places) -> Array:
        """Return theta and z of the used markers, shape (n, 2 m); one that never lands is far."""
        rows = np.hstack([places.theta[:, self._used], places.z[:, self._used]])
        far = np.concatenate([np.full(self._used.size, 1.5 * self._lay.end), np.zeros(self._used.size)])
        return np.where(np.isnan(rows), far, rows)

    def residuals(self, numbers: dict[str, Array]) -> Array:
        """Return residuals, shape (n, 2 m)."""
        off = self.predicted(self._lay(numbers)) + self.excess - self.measured
        return np.asarray(off @ self.white.T)

    def learn_excess(self, numbers: dict[str, Array]) -> None:
        """Find what the rod adds to the closed form at one cell.

        Raises:
            SolverError, ValueError: The rod fails.
        """
        plain = {**numbers, "eye": np.zeros(1), "camera_scale": np.zeros(1)}
        rod, closed = self._lay.rod(plain), self._lay(plain)
        known = np.isfinite(rod.theta + closed.theta)
        if not known[:, self._used].all():
            raise IdentificationError("a used marker does not land on the rod with the best numbers")
        self.excess = (self.predicted(rod) - self.predicted(closed))[0]


def whitening(readings: Readings) -> Array:
    """Return what makes residuals of angles and z standard normal, shape (2 m, 2 m)."""
    theta, z, count = readings.theta, readings.z, readings.ids.size
    covariance = np.zeros((2 * count, 2 * count))
    covariance[:count, :count] = (
        np.diag(readings.sigma_theta**2)
        + ANGLE_SHARE**2 * np.outer(theta, theta)
        + ANGLE_OFFSET**2
    )
    covariance[count:, count:] = (
        np.diag(readings.sigma_z**2 + Z_OFFSET**2) + Z_SHARE**2 * np.outer(z, z) + Z_OFFSET**2
    )
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))


def identify_cell(run: Measured, prior: CellPrior | None = None, draws: int = DRAWS) -> CellPosterior:
    """Return the posterior of a cell's numbers from one run.

    Raises:
        IdentificationError: The markers fit no cell of the prior, or the rod cannot wind it.
    """
    from scipy.special import chdtrc  # noqa: PLC0415 - a plan without a fit needs none

    prior = CellPrior() if prior is None else prior
    lay = CellLay(run.config, run.inputs)
    unknowns = prior.unknowns(run.config)
    coordinates = Coordinates(
        unknowns=unknowns,
        pull=lay.mean_pull,
        area=run.config.case.axial_area,
        wound=lay.wound,
    )
    markers = Whitened(lay, run.readings)
    u = coordinates.search(np.zeros((1, COUNT)))[0]
    information = np.eye(COUNT)
    calls = 0
    for calls in range(_ROD_CALLS + 1):
        before = u
        u, information, cost = _best(markers, coordinates, u)
        moved = before - u
        if calls > 0 and float(moved @ information @ moved) < _SETTLED**2 * COUNT:
            break
        if calls == _ROD_CALLS:
            break
        try:
            markers.learn_excess(coordinates.numbers(coordinates.deviates(u[None])))
        except (SolverError, ValueError) as error:
            raise IdentificationError(f"the rod cannot wind the best cell: {error}") from error
    measured = markers.measured.size
    squares = 2.0 * cost
    misfit = 1.0
    if float(chdtrc(measured, squares)) < _MISFIT:
        misfit = math.sqrt(squares / measured)
        information = information / misfit**2
    sample, weights = _drawn(markers, coordinates, u, information, misfit, draws)
    q = coordinates.deviates(sample)
    numbers = coordinates.numbers(q)
    best = coordinates.deviates(u[None])[0]
    off = q - weights @ q
    return CellPosterior(
        unknowns=unknowns,
        draws=numbers,
        weights=weights,
        best=best,
        covariance=np.asarray((off * weights[:, None]).T @ off),
        found=tuple(_found(unknowns, numbers, weights)),
        chi_square=squares,
        measured=measured,
        misfit=misfit,
        rod_calls=calls,
    )


def _residuals(markers: Whitened, coordinates: Coordinates, u: Array) -> Array:
    q = coordinates.deviates(u)
    return np.hstack([markers.residuals(coordinates.numbers(q)), q])


def _best(
    markers: Whitened, coordinates: Coordinates, u: Array
) -> tuple[Array, Array, float]:
    """Return optimum, information there, half the sum of squares; Levenberg and Marquardt."""
    probes = np.vstack([np.zeros(COUNT), _PROBE * np.eye(COUNT)])

    def around(place: Array) -> tuple[Array, Array, float]:
        rows = _residuals(markers, coordinates, place + probes)
        return rows[0], (rows[1:] - rows[0]) / _PROBE, 0.5 * float(rows[0] @ rows[0])

    base, slope, cost = around(u)
    damping = 1.0e-3
    for _ in range(_STEPS):
        information = slope @ slope.T
        pull = slope @ base
        damped = information + damping * np.diag(np.diag(information))
        step = np.clip(-np.linalg.solve(damped, pull), -1.5, 1.5)
        if -float(pull @ step) < 1.0e-3:
            break
        tried = around(u + step)
        if tried[2] < cost:
            u, (base, slope, cost) = u + step, tried
            damping = max(0.1 * damping, 1.0e-9)
        else:
            damping = min(10.0 * damping, 1.0e8)
    return u, slope @ slope.T, cost


def _drawn(
    markers: Whitened,
    coordinates: Coordinates,
    u: Array,
    information: Array,
    misfit: float,
    count: int,
) -> tuple[Array, Array]:
    """Return draws from a t distribution about the optimum and their weights, which sum to one."""
    rng = np.random.default_rng(0)
    spread = np.linalg.cholesky(np.linalg.inv(information))
    normal = rng.standard_normal((count, COUNT))
    normal[1::2] = -normal[: count - 1 : 2]
    tail = np.repeat(np.sqrt(_FREEDOM / rng.chisquare(_FREEDOM, (count + 1) // 2)), 2)[:count]
    sample = u + (normal * tail[:, None]) @ spread.T
    squares = (normal**2).sum(axis=1) * tail**2
    proposed = -0.5 * (_FREEDOM + COUNT) * np.log1p(squares / _FREEDOM)
    rows = _residuals(markers, coordinates, sample)
    fit = (rows[:, :-COUNT] ** 2).sum(axis=1) / misfit**2 + (rows[:, -COUNT:] ** 2).sum(axis=1)
    weight = -0.5 * fit - proposed
    weight = np.exp(weight - weight.max())
    return sample, weight / weight.sum()


def _found(unknowns: tuple[Unknown, ...], numbers: dict[str, Array], weights: Array) -> list[Found]:
    rng = np.random.default_rng(1)
    before = {item.name: item.value(rng.standard_normal(4000)) for item in unknowns}
    rows = [(item.name, item.words, item.unit) for item in unknowns if item.asked and not item.known]
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
        values, prior = numbers[name], before[name]
        mean = float(weights @ values)
        low, high = interval_of(values, weights)
        prior_low, prior_high = np.quantile(prior, [0.05, 0.95])
        made.append(
            Found(
                name=name,
                words=words,
                unit=unit,
                mean=mean,
                deviation=math.sqrt(float(weights @ (values - mean) ** 2)),
                low=low,
                high=high,
                prior_low=float(prior_low),
                prior_high=float(prior_high),
                prior_deviation=float(prior.std()),
            )
        )
    return made


