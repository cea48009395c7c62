"""The most informative motion: expected information by sensitivities of the markers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cable_fem_node.identification import Readings
from cable_fem_node.winding.winding_config import WindingConfig
from winding_study.commissioning.lay import CellLay
from winding_study.commissioning.motion import Motion
from winding_study.commissioning.posterior import CellPosterior, whitening
from winding_study.commissioning.unknowns import COUNT, Array, CellPrior, Unknown, numbers_of

_PROBE = 1.0e-3
# Cells of the prior over which sensitivities are averaged, the middle one among them.
_CELLS = 4
# What a tracker of the small cylinder measures a resting marker with, over the frames of a lap.
SIGMA_THETA, SIGMA_Z = 1.1e-3, 0.04e-3
# A marker is read once the cylinder has turned this much further [rad].
SEEN_AFTER = 0.5


@dataclass(frozen=True, kw_only=True)
class Expected:
    """The expected information of a motion.

    Attributes:
        gain: Mean of ln of how much smaller the volume of what is looked for becomes [nat].
        share: Expected deviation of each number over that before, by name; of its normal deviate.
        markers: How many markers it lands in the middle of the prior.
    """

    motion: Motion
    gain: float
    share: dict[str, float]
    markers: int

    @property
    def most(self) -> str:
        """Name of the number that it narrows most."""
        return min(self.share, key=lambda name: self.share[name])


def sensitivities(
    lay: CellLay, unknowns: tuple[Unknown, ...], q: Array
) -> tuple[Array, Readings | None]:
    """Return the slopes of whitened angles and z, shape (COUNT, 2 m), and where markers lie.

    Forward differences of the closed form by the normal deviates of the numbers.

    Args:
        lay: Of the motion.
        unknowns: What the numbers are.
        q: Deviates of one cell, shape (COUNT,).
    """
    rows = q + np.vstack([np.zeros(COUNT), _PROBE * np.eye(COUNT)])
    places = lay(numbers_of(unknowns, rows))
    seen = np.isfinite(places.theta).all(axis=0) & (places.theta[0] < lay.end - SEEN_AFTER)
    if not seen.any():
        return np.zeros((COUNT, 0)), None
    ids = np.flatnonzero(seen) + 1
    readings = Readings(
        ids=ids.astype(np.int64),
        theta=places.theta[0, seen],
        z=places.z[0, seen],
        sigma_theta=np.full(ids.size, SIGMA_THETA),
        sigma_z=np.full(ids.size, SIGMA_Z),
    )
    both = np.hstack([places.theta[:, seen], places.z[:, seen]])
    slope = (both[1:] - both[0]) / _PROBE
    middle = numbers_of(unknowns, q[None])
    return slope @ whitening(readings, lay, middle).T, readings


def ranked(
    config: WindingConfig,
    motions: Iterable[Motion],
    prior: CellPrior,
    known: CellPosterior | None = None,
) -> list[Expected]:
    """Return the expected information of every motion, the most first.

    Args:
        config: What is wound, as far as it is known.
        motions: That the machine can make.
        prior: What was known before.
        known: What a run has determined since; None before the first.
    """
    unknowns = prior.unknowns(config)
    asked = [k for k, item in enumerate(unknowns) if item.asked and not item.known]
    if known is None:
        rng = np.random.default_rng(2)
        places: Array = np.vstack([np.zeros(COUNT), 0.7 * rng.standard_normal((_CELLS - 1, COUNT))])
        before: Array = np.eye(COUNT)
    else:
        places, before = known.deviates[None], known.covariance
    # What is known has no deviation to lose.
    held = np.array([item.known for item in unknowns])
    if known is not None:
        before = before + np.diag(np.where(held, 1.0, 1.0e-9))
    prior_information = np.asarray(np.linalg.inv(before), dtype=np.float64)
    rows = [
        _expected(config, motion, unknowns, asked, places, before, prior_information)
        for motion in motions
    ]
    return sorted(rows, key=lambda row: -row.gain)


def _expected(
    config: WindingConfig,
    motion: Motion,
    unknowns: tuple[Unknown, ...],
    asked: list[int],
    places: Array,
    before: Array,
    information: Array,
) -> Expected:
    lay = CellLay(config, motion.inputs(), motion)
    gains, shares, markers = [], [], 0
    own = np.ix_(asked, asked)
    volume = np.linalg.slogdet(before[own])[1]
    for place in places:
        slope, readings = sensitivities(lay, unknowns, place)
        after = np.linalg.inv(information + slope @ slope.T)
        gains.append(0.5 * (volume - np.linalg.slogdet(after[own])[1]))
        shares.append(np.sqrt(np.diag(after) / np.diag(before)))
        if readings is not None and not markers:
            markers = readings.ids.size
    mean = np.mean(shares, axis=0)
    return Expected(
        motion=motion,
        gain=float(np.mean(gains)) if math.isfinite(float(np.mean(gains))) else -math.inf,
        share={unknowns[k].name: float(mean[k]) for k in asked},
        markers=markers,
    )
