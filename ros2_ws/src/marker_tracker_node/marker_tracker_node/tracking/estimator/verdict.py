"""Which configured number the sightings contradict: the prior whose release explains them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.tracking.estimator.fit import LEAST_INFORMATION, SURE, Fit, fitted
from marker_tracker_node.tracking.estimator.numbers import BAND, CLOCK, COUNT, NUMBERS, ZERO
from marker_tracker_node.tracking.estimator.problem import Problem
from marker_tracker_node.tracking.frame.laid_path import FARTHEST

# Releasing a prior must explain so much: in 101 consistent films it explained 9.3 at most.
_LEAST_GAIN = 10.0
# And the number must be off by so many deviations, its doubt among them.
SIGNIFICANT = 2.5
# Sightings that are neighbours err together: differences of cost are 2 to 3 times too large.
DEPENDENT = 2.5
# What costs no more than this beyond the best explanation is one, too.
AS_WELL = 14.0
# Two coordinates of an explained sighting leave a square of 3.2 in four of five, and bands of eight
# pixels, whose masks err more, up to 6.6: so much is not.
EXPLAINED = SURE**2
# What gains less than this share of the best is not tried, and not named beside it: a large error
# leaves bends that a small turn of the camera takes up. For those bends what lacks no more than
# this share of the best gain explains as well, too: up to 0.12 in films of thick cable.
_LEAST_SHARE = 0.1
# A number within its doubt is named if it alone explains so much, and leaves no more than this
# share: in 101 consistent films the best one explained 24 at most, and left 0.54 or more.
LEAST_ALONE, LEFT_ALONE = FARTHEST**2, 0.3


class Explanation(NamedTuple):
    """A number that explains the sightings if it is set wrongly."""

    number: int  # Index in `NUMBERS`
    error: float  # By how much it is set too large
    sigma: float  # Of the error
    fit: Fit  # With that prior released
    doubted: bool = False  # Whether the error is within what is doubted, and the fit the usual one

    @property
    def left(self) -> bool:
        """Whether the error exceeds what is doubted of the number."""
        doubt = math.hypot(NUMBERS[self.number].doubt, self.sigma)
        return abs(self.error) > SIGNIFICANT * doubt

    @property
    def inside(self) -> bool:
        """Whether the error is no bound."""
        return abs(self.error) < NUMBERS[self.number].most


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What the sightings say of the configured numbers.

    Attributes:
        wrong: None, one or two; each with what explains it as well.
        fits: With every number as configured, and with each of those in its place.
    """

    wrong: tuple[tuple[Explanation, ...], ...]
    fits: tuple[Fit, ...]
    explained: bool = True  # Whether what is wrong explains the sightings

    @property
    def released(self) -> tuple[Explanation, ...]:
        """Numbers beyond their doubt that explain the sightings best; empty for none."""
        beyond = [group for group in self.wrong if not group[0].doubted]
        return tuple(one for one in beyond[-1] if one.left) if beyond else ()

    @property
    def best(self) -> Fit:
        """What explains the sightings best."""
        return min(self.fits, key=lambda fit: fit.cost)


def judged(problem: Problem) -> Verdict:
    """Return which numbers are contradicted, with their alternatives."""
    usual = fitted(problem, problem.prior, problem.start)
    # A mask bends the first pass of P0 as a wrong number does.
    least = _LEAST_GAIN * (1.0 if problem.markers.size > 1 else DEPENDENT)
    first = _explanations(problem, usual, least)
    wrong: tuple[tuple[Explanation, ...], ...] = (first,) if first else ()
    if first:
        # One number that explains as well as two is the one.
        second = _explanations(problem, first[0].fit, AS_WELL)
        wrong = (first, second) if second else wrong
    # One number is named, or two.
    if len(wrong) < 2 and problem.markers.size > 1:
        fit = first[0].fit if first else usual
        least = max(LEAST_ALONE, _LEAST_SHARE * (usual.cost - fit.cost))
        beside = _within_doubt(fit, [one[0].number for one in wrong], least)
        # What takes up the difference between two explanations of the first is no other number.
        named = {one.number for one in first}
        wrong += tuple(group for group in beside if not named & {one.number for one in group})
    verdict = Verdict(wrong=wrong, fits=(usual, *_released(problem, wrong)))
    if verdict.best.rest > EXPLAINED:
        far = _furthest(usual)
        return Verdict(wrong=(far,), fits=(usual,), explained=False)
    return verdict


def _released(problem: Problem, wrong: tuple[tuple[Explanation, ...], ...]) -> Iterator[Fit]:
    """Yield fits with what is wrong released, each number of a group in its place."""
    best = [group[0].number for group in wrong]
    for place, group in enumerate(wrong):
        for one in group:
            if not (one.left or one.doubted):
                continue
            chosen = [*best[:place], one.number, *best[place + 1 :]]
            prior = problem.prior.copy()
            prior[chosen] = [NUMBERS[number].most ** -2 for number in chosen]
            yield fitted(problem, prior, problem.centred(one.fit.x))


def _within_doubt(
    fit: Fit, named: list[int], least_gain: float
) -> tuple[tuple[Explanation, ...], ...]:
    """Return the numbers that explain the sightings beside those named, all others as configured.

    None where many numbers are a little wrong, or all are right. About a fit the cost of the
    sightings is a parabola of the numbers; the prior pulls as much as the sightings there.
    """
    data, _, _ = fit.information(np.arange(COUNT))
    x, pull = fit.x[:COUNT], (fit.prior * fit.x)[:COUNT]
    strength, axes = np.linalg.eigh(data)
    held = strength > LEAST_INFORMATION * strength[-1]
    least = -float(((axes.T @ pull)[held] ** 2 / strength[held]).sum())

    def errors(numbers: list[int]) -> FloatArray:
        """Return those of least cost of some numbers while all others are right."""
        found = np.zeros(COUNT)
        own = np.ix_(numbers, numbers)
        found[numbers] = np.linalg.lstsq(data[own], (pull + data @ x)[numbers], rcond=None)[0]
        return found

    def cost(numbers: list[int]) -> float:
        away = errors(numbers) - x
        return float(away @ data @ away - 2.0 * pull @ away) - least

    found, chosen = list(named), list(named)
    left = now = cost(named)
    while len(chosen) < 2:
        others = [k for k in range(COUNT) if k not in chosen]
        chosen.append(min(others, key=lambda k: cost([*chosen, k])))
        before, now = now, cost(chosen)
        if before - now < least_gain:
            break
        if now <= LEFT_ALONE * left:
            found, left = list(chosen), now
    groups = []
    for number in found[len(named) :]:
        beside = [k for k in found if k != number]
        costs = {k: cost([*beside, k]) for k in range(COUNT) if k not in beside}
        order = sorted((k for k in costs if costs[k] < left + AS_WELL), key=lambda k: costs[k])
        sizes = {k: float(errors([*beside, k])[k]) for k in order}
        # Wound angles are counted from P0 itself, and the clock is judged by its own offset; half
        # of what is doubted of a number is what it usually is off by.
        usual = all(abs(sizes[k]) < 0.5 * NUMBERS[k].doubt for k in order)
        if not (usual or set(order) <= {ZERO, CLOCK}):
            spread = {k: float(data[k, k]) ** -0.5 for k in order}
            # Bands so much smaller or larger than they should be are measured in part.
            doubted = order[0] != BAND
            groups.append(
                tuple(Explanation(k, sizes[k], spread[k], fit, doubted=doubted) for k in order)
            )
    return tuple(groups)


def _furthest(usual: Fit) -> tuple[Explanation, ...]:
    """Return the numbers that a fit takes far from what was configured, the furthest first."""
    away = [(abs(float(usual.x[k])) / NUMBERS[k].doubt, k) for k in range(COUNT)]
    away.sort(reverse=True)
    return tuple(
        Explanation(k, float(usual.x[k]), math.nan, usual)
        for size, k in away
        if size >= min(SURE, away[0][0])
    )


def _explanations(problem: Problem, usual: Fit, least: float) -> tuple[Explanation, ...]:
    """Return what explains the sightings by a least gain better than a fit does, best first."""
    covariance = usual.covariance
    promised = []
    for number in range(COUNT):
        released = usual.prior[number] - NUMBERS[number].most ** -2
        if released <= 0.0:
            continue
        left = max(1.0 - released * float(covariance[number, number]), 1.0e-9)
        error = float(usual.x[number]) / left
        promised.append((released * float(usual.x[number]) * error, number, error))
    promised.sort(reverse=True)
    found = []
    for gain, number, error in promised:
        # A step of outliers and bends promises half of what it leads to.
        if gain < max(least / DEPENDENT, _LEAST_SHARE * promised[0][0]):
            break
        prior, most = usual.prior.copy(), NUMBERS[number].most
        prior[number] = most**-2
        aim = min(max(error, -most), most)
        along = covariance[:, number] / covariance[number, number]
        start = problem.centred(usual.x + along * (aim - usual.x[number]))
        fit = fitted(problem, prior, start)
        sigma = math.sqrt(float(fit.covariance[number, number]))
        found.append(Explanation(number, float(fit.x[number]), sigma, fit))
    found.sort(key=lambda one: one.fit.cost)
    if not found or usual.cost - found[0].fit.cost < least:
        return ()
    most = max(AS_WELL, _LEAST_SHARE * (usual.cost - found[0].fit.cost))
    close = [one for one in found if one.fit.cost < found[0].fit.cost + most and one.inside]
    # What explains as well is named behind a number that is beyond its doubt, whatever its own.
    close.sort(key=lambda one: not one.left)
    return tuple(close) if close and close[0].left else ()
