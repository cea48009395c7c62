"""What of the configured numbers the sightings correct, and where the markers then lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marker_tracker_node.arrays import FloatArray, IndexArray
from marker_tracker_node.tracking.estimator.fit import SURE, carried_correction, fitted
from marker_tracker_node.tracking.estimator.numbers import COUNT, FOCAL, SCALE, TILT, TIMES
from marker_tracker_node.tracking.estimator.problem import HELD, Problem
from marker_tracker_node.tracking.estimator.verdict import (
    AS_WELL,
    DEPENDENT,
    EXPLAINED,
    Verdict,
)
from marker_tracker_node.tracking.frame.laid_path import FARTHEST


@dataclass(frozen=True, kw_only=True)
class Correction:
    """What is measured with from now on.

    Attributes:
        carried: Whether the sightings carry a correction of the numbers with which the run began.
        posed: Whether no number is beyond its doubt, or one of the camera's pose explains as much.
        errors: By how much each of `NUMBERS` is taken to be set too large, shape (numbers,).
        doubt: Variances of theta [rad^2] and z [m^2] that follow from what is not known of
            corrected numbers, shape (2, k).
    """

    carried: bool
    posed: bool
    errors: FloatArray
    markers: IndexArray  # Numbers of those that were seen, shape (k,)
    theta: FloatArray  # Their wound angles from P0 [rad], shape (k,)
    z: FloatArray  # Their z from P0 [m], shape (k,)
    doubt: FloatArray
    unexplained: IndexArray  # Numbers of those whose sightings these numbers do not explain
    area: float  # Logarithm of a band's area over that of the configured numbers


def correction(problem: Problem, verdict: Verdict, *, made: bool) -> Correction | None:
    """Return what the sightings correct; None where nothing is to be changed.

    If they were measured with a correction, `made`, that may have to be taken back.
    """
    others = verdict.released
    turning = {one.number in (SCALE, TIMES) for one in others}
    if not verdict.explained or problem.markers.size < 2 or len(turning) > 1:
        # Where the cylinder stands is not changed for what may be a camera elsewhere.
        return None
    fit = verdict.best
    numbers, rest = slice(0, COUNT), np.arange(COUNT, fit.x.size)
    data, follow, _ = fit.information(np.arange(COUNT))
    begun, sigmas = problem.begun, fit.prior[numbers] ** -0.5
    moved, covariance = carried_correction(data, fit.x[numbers] - begun, -begun, sigmas, FARTHEST)
    aside = begun - fit.x[numbers]
    doubtful = float(aside @ data @ aside) > SURE**2
    if not (moved.any() or made or doubtful):
        return None
    errors = begun + moved
    x, clear = fit.x.copy(), np.ones(problem.markers.size, dtype=bool)
    x[numbers] = errors
    x[rest] -= follow @ (errors - fit.x[numbers])
    if moved.any() or made:
        prior = fit.prior.copy()
        prior[numbers] = HELD
        centre = np.append(errors, np.zeros(rest.size))
        x = fitted(problem, prior, problem.centred(x), centre).x
        clear = problem.unexplained(x) < EXPLAINED
    if not clear[0]:
        # From P0 all others are counted.
        return None
    places, best = problem.places(x), problem.places(fit.x)
    # What is not taken counts as error.
    doubt = np.square(places - best)
    if moved.any():
        doubt = np.diag(follow @ covariance @ follow.T)[: places.size].reshape(places.shape)
    # What explains the sightings as well may be what is wrong: alternatives are named as equals,
    # the configured numbers count by their likelihood.
    beyond = np.array([one.cost for one in verdict.fits]) - fit.cost
    likely = np.exp(-0.5 * beyond / [DEPENDENT, *[AS_WELL] * (beyond.size - 1)])
    away = [np.square(problem.places(one.x) - best) for one in verdict.fits]
    doubt = doubt + np.einsum("f,fpm->pm", likely / likely.sum(), away)
    return Correction(
        carried=bool(moved.any()),
        posed=not others or any(TILT <= one.number < FOCAL for one in others),
        errors=errors,
        markers=problem.markers[clear],
        unexplained=problem.markers[~clear],
        theta=places[0, clear],
        z=places[1, clear],
        doubt=doubt[:, clear] * doubtful,
        area=problem.area_of(errors),
    )
