"""The search for the rigs that explain where markers lie: optima, evidence, weighted draws."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.mixture import Mixture, weighted_draws
from cable_fem_node.identification.rig import Numbers, RigCoordinates, unknowns_of
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_part import RigPart
from cable_fem_node.identification.rig_rod import RodExcess, rod_excess
from cable_fem_node.identification.tracked_run import IdentificationError, TrackedRun
from cable_fem_node.winding.rig_prior import RigPrior

# No coordinate moves farther in one step: they are normal deviates and logarithms.
_FARTHEST_STEP = 1.5


def optimum(
    residuals: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    *,
    probe: float,
    steps: int,
    settled: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the coordinates with the smallest sums of squares, and what is known of them there.

    Slopes are forward differences. A search ends when all its next steps promise less than twice
    a gain, whether or not rounding lets that be seen.

    Args:
        residuals: Returns standard normal residuals, shape (c, k + 1, m), at coordinates, shape
            (c, k + 1, k).
        start: Coordinates, shape (c, k).
        probe: Length of a forward difference, in coordinates [1].
        steps: Most of them.
        settled: Twice the gain in half a sum of squares [1] below which no step is taken.

    Returns:
        Coordinates, shape (c, k); information, shape (c, k, k); half the sums of squares, (c,).
    """
    count, size = start.shape
    probes = np.vstack([np.zeros(size), probe * np.eye(size)])

    def around(q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        rows = residuals(q[:, None, :] + probes)
        base = rows[:, 0]
        return base, (rows[:, 1:] - base[:, None]) / probe, 0.5 * (base**2).sum(axis=1)

    q = start
    base, slope, cost = around(q)
    damping = np.full(count, 1.0e-3)
    for _ in range(steps):
        information = slope @ slope.transpose(0, 2, 1)
        diagonal = np.einsum("cii->ci", information)
        damped = information + (damping[:, None] * diagonal)[:, None] * np.eye(size)
        pull = np.einsum("cij,cj->ci", slope, base)
        step = -np.linalg.solve(damped, pull[..., None])[..., 0]
        step = np.clip(step, -_FARTHEST_STEP, _FARTHEST_STEP)
        if np.max(-np.einsum("ci,ci->c", pull, step)) < settled:
            break
        tried = around(q + step)
        better = tried[2] < cost
        q = np.where(better[:, None], q + step, q)
        base = np.where(better[:, None], tried[0], base)
        slope = np.where(better[:, None, None], tried[1], slope)
        cost = np.where(better, tried[2], cost)
        damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1.0e-9, 1.0e6)
    return q, slope @ slope.transpose(0, 2, 1), cost


# The normal deviate of ln L_c is searched about these places, with this deviation each: together
# they make up a standard normal.
_PLACES = np.linspace(-1.8, 1.8, 8)
_NARROW = 0.5
# Deviates of the C01 share from which every one of them is searched: modulus, drag and brake follow
# the share along a bent valley, in which steps come to rest too early.
_BENDS = np.array([-1.0, 0.0, 1.0])
_STEPS = 40
_PROBE = 1.0e-3
_SETTLED = 2.0e-3  # Twice the gain in half a sum of squares below which a step is not worth taking
# The rod is wound at so many optima at most, and with other elements at so many. It rests where it
# moves the optimum by less than this share of a deviation.
_ROD_CALLS, _OTHER_ELEMENTS, _RESTS = 6, 2, 0.2
# Elements of another length, over those of a prediction: from 0.6 to 1.3 angles move in proportion.
_COARSER = 1.25
# Rigs of the posterior that are wound to see how far what the rod adds at the best one holds.
_OTHER_RIGS = 6
DRAWS = 600  # As many as a 5 % quantile needs to be known to a twentieth of the interval
# Draws that count, over all; rounds in which the proposal is adapted to it.
_ENOUGH, _ROUNDS = 0.3, 5


@dataclass(frozen=True, kw_only=True)
class _Modes:
    """The best coordinates with a steady tension, and about each place of the build-up."""

    steady: NDArray[np.bool_]  # True for the rig whose tension does not build up, shape (c,)
    prior: FloatArray  # ln of the prior density at its place, shape (c,)
    best: FloatArray  # Shape (c, k)
    information: FloatArray  # Shape (c, k, k)
    cost: FloatArray  # Half the sum of squares, shape (c,)

    @property
    def evidence(self) -> FloatArray:
        """Logarithm of each mode's part of the evidence, but for a constant, shape (c,)."""
        _, volume = np.linalg.slogdet(self.information)
        return np.asarray(self.prior - self.cost - 0.5 * volume)


class RigSearch:
    """Finds and draws the rigs that explain where markers lie.

    Args:
        runs: Of one cable on one rig, at least one.
        prior: What was known before.
        lays: Closed forms of the runs.
        before: A search of the same runs to go on from.
        excess: What the rod adds to each closed form; None: nothing.
    """

    def __init__(
        self,
        runs: Sequence[TrackedRun],
        prior: RigPrior,
        lays: Sequence[RigLay],
        before: RigSearch | None = None,
        excess: Sequence[RodExcess] | None = None,
    ) -> None:
        about = None if before is None else before.best
        added: Sequence[RodExcess | None] = [None] * len(runs) if excess is None else excess
        pairs = zip(runs, lays, added, strict=True)
        self.parts = [RigPart.of(run, lay, prior, about, own) for run, lay, own in pairs]
        self.prior, self.excess = prior, excess
        first, config = runs[0].readings, runs[0].config
        case, last = config.case, float(first.theta[-1])
        self.coordinates = RigCoordinates(
            unknowns=unknowns_of(prior, config),
            pull=lays[0].mean_pull(last),
            area=case.axial_area,
            wound=case.centreline_radius * last,
        )
        length = float(np.hypot(case.centreline_radius * last, first.z[-1]))
        stretch = length / (float(first.ids[-1]) * case.marker_spacing)
        start = self.coordinates.start(lays[0].stress_of(stretch))
        self.modes: _Modes = self._find(start if before is None else before.modes.best)

    @property
    def measured(self) -> int:
        """How many numbers were measured."""
        return sum(2 * part.used.size for part in self.parts)

    @property
    def _first(self) -> int:
        return int(np.argmax(self.modes.evidence))

    @property
    def place(self) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Coordinates of the best rig, shape (1, k), and whether its tension is steady, (1,)."""
        at = slice(self._first, self._first + 1)
        return self.modes.best[at], self.modes.steady[at]

    @property
    def best(self) -> Numbers:
        """The rig with the greatest evidence, shape (1,) each."""
        return self.coordinates.numbers(*self.place)

    @property
    def chi_square(self) -> float:
        """Sum of squares of the best rig, prior included."""
        return 2.0 * float(self.modes.cost[self._first])

    @property
    def evidence(self) -> float:
        """Logarithm of the density of the measurements, but for a constant of the runs."""
        whitened = sum(
            float(np.log(np.diag(white)).sum())
            for part in self.parts
            for white in (part.white_theta, part.white_z)
        )
        return whitened + float(np.logaddexp.reduce(self.modes.evidence))

    def with_rod(self) -> RigSearch:
        """Return the search with what the rod adds, found at the best rig until that rests.

        How it differs at other rigs of the posterior belongs to the deviations of the model.

        Raises:
            IdentificationError: The rod cannot wind the best rig.
        """
        search = self
        for attempt in range(_ROD_CALLS):
            before, (u,) = search, search.place[0]
            information = search.modes.information[search._first]
            search = search._with(search._asked(attempt < _OTHER_ELEMENTS))
            moved = search.place[0][0] - before.place[0][0]
            if attempt and moved @ information @ moved < _RESTS**2 * u.size:
                break
        return search._with(search._elsewhere())

    def _with(self, excess: list[RodExcess]) -> RigSearch:
        runs, lays = zip(*((part.run, part.lay) for part in self.parts), strict=True)
        return RigSearch(runs, self.prior, lays, self, excess)

    def _asked(self, other_elements: bool) -> list[RodExcess]:
        """Return what the rod adds at the best rig, and what it adds with other elements."""
        best, found = self.best, []
        for part in self.parts:
            value = rod_excess(part.lay, best, part.used)
            by_element = np.zeros_like(value) if part.excess is None else part.excess.by_element
            if other_elements:
                coarse = rod_excess(part.lay, best, part.used, _COARSER)
                by_element = (coarse - value) / (_COARSER - 1.0)
            others = np.zeros((0, value.size))
            found.append(RodExcess(value=value, by_element=by_element, others=others))
        return found

    def _elsewhere(self) -> list[RodExcess]:
        """Return what the rod adds, with what it adds at some rigs of the posterior."""
        u, steady, weights = self.draw(DRAWS)
        ends = (np.arange(_OTHER_RIGS) + 0.5) / _OTHER_RIGS
        rows = np.searchsorted(np.cumsum(weights), ends)
        found = []
        for part in self.parts:
            assert part.excess is not None
            others = []
            for row in rows.tolist():
                rig = self.coordinates.numbers(u[row : row + 1], steady[row : row + 1])
                try:
                    others.append(rod_excess(part.lay, rig, part.used) - part.excess.value)
                except IdentificationError:
                    # A rig that the rod cannot wind is none of the posterior's.
                    continue
            rows_of = np.reshape(others, (-1, 2 * part.used.size))
            found.append(dataclasses.replace(part.excess, others=rows_of))
        return found

    def draw(self, count: int) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
        """Return coordinates, whether each is steady, and weights, see `weighted_draws`."""
        modes = self.modes
        spread = np.asarray(np.linalg.inv(modes.information), dtype=np.float64)
        proposal = Mixture.of(modes.evidence, modes.best, spread, modes.steady)
        # A probability of zero has no draws of its kind.
        known = np.log(np.maximum([1.0 - self.prior.steady, self.prior.steady], 1.0e-300))

        def density(u: FloatArray, steady: NDArray[np.bool_]) -> FloatArray:
            residuals, more = self._residuals(u, steady)
            found = known[steady.astype(int)] + more - 0.5 * (residuals**2).sum(axis=1)
            return np.asarray(found)

        return weighted_draws(proposal, density, count, rounds=_ROUNDS, enough=_ENOUGH)

    def _residuals(self, u: FloatArray, steady: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        """Return residuals, the k of the prior last, and what else ln of the density has."""
        rigs = self.coordinates.numbers(u, steady)
        prior, more = self.coordinates.prior(u, rigs)
        rows = [part.residuals(rigs) for part in self.parts]
        return np.hstack([*rows, prior]), more

    def _find(self, start: FloatArray) -> _Modes:
        chance, size = self.prior.steady, start.shape[-1]
        build_up = self.coordinates.place_of("build_up_length")
        kinds = [(True, 0.0, 1.0, chance)] if chance > 0.0 else []
        if chance < 1.0 and build_up is None:
            kinds.append((False, 0.0, 1.0, 1.0 - chance))
        elif chance < 1.0:
            share = np.exp(-0.5 * _PLACES**2 / (1.0 - _NARROW**2))
            share *= (1.0 - chance) / share.sum()
            kinds += [(False, at, _NARROW, own) for at, own in zip(_PLACES, share, strict=True)]
        law = self.coordinates.place_of("law_share")
        bends = np.zeros(1) if law is None else _BENDS
        kinds = [(*kind[:3], kind[3] / bends.size) for kind in kinds for _ in bends]
        steady, place, narrow, own = (np.array(row) for row in zip(*kinds, strict=True))
        repeated = [np.repeat(values, size + 1) for values in (steady, place, narrow)]

        def residuals(u: FloatArray) -> FloatArray:
            flags, at, deviation = repeated
            u = u.reshape(-1, size)
            rows, _ = self._residuals(u, flags)
            if build_up is not None:
                rows[:, build_up - size] = (u[:, build_up] - at) / deviation
            return rows.reshape(steady.size, size + 1, -1)

        start = np.broadcast_to(start, (steady.size, size)).copy()
        if build_up is not None:
            start[:, build_up] = place
        if law is not None:
            start[:, law] = np.resize(bends, steady.size)
        best, information, cost = optimum(
            residuals, start, probe=_PROBE, steps=_STEPS, settled=_SETTLED
        )
        return _Modes(
            steady=steady,
            prior=np.log(own) - np.log(narrow),
            best=best,
            information=information,
            cost=cost,
        )
