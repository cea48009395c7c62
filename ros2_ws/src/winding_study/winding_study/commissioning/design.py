"""The most informative motion: expected information by sensitivities of the markers."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification import Readings, RigPosterior, RigPrior, TrackedRun
from cable_fem_node.identification.rig import Unknown, numbers_of, opened, unknowns_of
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_part import RigPart
from cable_fem_node.winding.winding_config import WindingConfig
from winding_study.commissioning.motion import Motion

_PROBE = 1.0e-3
_RIGS = 4  # Rigs of the prior over which sensitivities are averaged, the middle one among them
# What a tracker of the small cylinder measures a resting marker with, over the frames of a lap.
SIGMA_THETA, SIGMA_Z = 1.1e-3, 0.04e-3
SEEN_AFTER = 0.5  # A marker is read once the cylinder has turned this much further [rad]


@dataclass(frozen=True, kw_only=True)
class Expected:
    """The expected information of a motion."""

    motion: Motion
    gain: float  # Mean of ln of how much smaller the volume of what is looked for becomes [nat]
    # Expected deviation of each number over that before, by name; of its normal deviate.
    share: dict[str, float]
    markers: int  # How many markers it lands in the middle of the prior

    @property
    def most(self) -> str:
        """Name of the number that it narrows most."""
        return min(self.share, key=lambda name: self.share[name])


def sensitivities(lay: RigLay, prior: RigPrior, q: FloatArray) -> tuple[FloatArray, int]:
    """Return the slopes of whitened angles and z, shape (k, 2 m), and how many markers land.

    Forward differences of the closed form by the normal deviates of the open numbers.

    Args:
        lay: Closed form of the motion.
        prior: What the numbers are.
        q: Deviates of one rig, shape (k,).
    """
    unknowns = unknowns_of(prior, lay.config)
    middle = numbers_of(unknowns, q[None])
    theta, z = (row[0] for row in lay(middle))
    seen = theta < lay.end - SEEN_AFTER
    if not seen.any():
        return np.zeros((q.size, 0)), 0
    ids = np.flatnonzero(seen) + 1
    run = TrackedRun(
        config=lay.config,
        inputs=lay.inputs,
        readings=Readings(
            ids=ids.astype(np.int64),
            theta=theta[seen],
            z=z[seen],
            sigma_theta=np.full(ids.size, SIGMA_THETA),
            sigma_z=np.full(ids.size, SIGMA_Z),
        ),
    )
    part = RigPart.of(run, lay, prior, middle)
    probes = q + np.vstack([np.zeros(q.size), _PROBE * np.eye(q.size)])
    rows = part.residuals(numbers_of(unknowns, probes))
    return (rows[1:] - rows[0]) / _PROBE, ids.size


def ranked(
    config: WindingConfig,
    motions: Iterable[Motion],
    prior: RigPrior,
    known: RigPosterior | None = None,
) -> list[Expected]:
    """Return the expected information of every motion, the most first.

    Args:
        config: What is wound, as far as it is known.
        motions: That the machine can make.
        prior: What was known before.
        known: What a run has determined since; None before the first.
    """
    sought = opened(unknowns_of(prior, config))
    if known is None:
        rng, size = np.random.default_rng(2), len(sought)
        others = 0.7 * rng.standard_normal((_RIGS - 1, size))
        places, before = np.vstack([np.zeros(size), others]), np.eye(size)
    else:
        places, before = known.deviates[None], known.spread + 1.0e-9 * np.eye(len(sought))
    rows = [_expected(config, motion, prior, sought, places, before) for motion in motions]
    return sorted(rows, key=lambda row: -row.gain)


def _expected(
    config: WindingConfig,
    motion: Motion,
    prior: RigPrior,
    sought: tuple[Unknown, ...],
    places: FloatArray,
    before: FloatArray,
) -> Expected:
    lay = RigLay(config, motion.inputs(), commanded=motion.commanded)
    information = np.asarray(np.linalg.inv(before))
    gains, shares, markers = [], [], 0
    asked = [k for k, item in enumerate(sought) if item.asked]
    own = np.ix_(asked, asked)
    volume = np.linalg.slogdet(before[own])[1]
    for place in places:
        slope, landed = sensitivities(lay, prior, place)
        after = np.linalg.inv(information + slope @ slope.T)
        gains.append(0.5 * (volume - np.linalg.slogdet(after[own])[1]))
        shares.append(np.sqrt(np.diag(after) / np.diag(before)))
        markers = markers or landed
    mean = np.mean(shares, axis=0)
    return Expected(
        motion=motion,
        gain=float(np.mean(gains)) if math.isfinite(float(np.mean(gains))) else -math.inf,
        share={sought[k].name: float(mean[k]) for k in asked},
        markers=markers,
    )
