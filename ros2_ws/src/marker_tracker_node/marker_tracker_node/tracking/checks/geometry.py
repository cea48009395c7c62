"""Cylinder, cable and camera judged by how far bands move over the picture, and how large they are.

A number that is configured wrongly changes both in a direction of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from marker_tracker_node.camera.pinhole import CameraView
from marker_tracker_node.detection.band import Band, Body, band_centroid, solve_band
from marker_tracker_node.detection.colour_band import WHOLE_AREA
from marker_tracker_node.tracking.checks.contradiction import (
    Contradiction,
    Evidence,
    Signature,
    size_in_words,
)
from marker_tracker_node.tracking.checks.passings import Passing, Slope, motion_of

# Change of a number whose effect is looked at; effects are straight over several percent.
_STEP = 0.01
_AZIMUTHS = np.linspace(-0.9, 0.9, 19)


# Consistent runs (twelve of the paper, by 4 to 10 px/mm): bands seem to move 0.1 to 0.5 % faster
# and to be 1 to 5 % smaller than they are, as their edges are mixed pixels; turns are right to
# 0.05 %.
USUAL = Signature(0.003, -0.03)
SIGMA = Signature(0.003, 0.03)
LEAST_MOTION = 0.009
# What chance alone may do, in deviations of the fit.
CHANCE = 4.0
# Blur, highlights and exposure change the area of bands that move as they should by up to this.
_LEAST_AREA = 0.2
# Farther than this many deviations from every number alone, none of them explains the bands.
_EXPLAINED = 3.0
# A number that leaves no more than this beyond the best one is named as well.
_AS_WELL = 1.25
# Bands that are off by more deviations in size are no matter of angles and times alone.
_SIZED = 2.0
# No diameter is set so wrongly.
_MOST_SHARE = 0.25


def signatures(view: CameraView, body: Body) -> Mapping[str, Signature]:
    """Return, by the name of the number, what setting it one percent too large changes.

    The focal length and the camera's distance do the same, with opposite signs.

    Args:
        view: The camera as configured.
        body: What the bands are painted on, as configured.
    """
    radius = body.rho - body.cable_radius
    smaller = 1.0 / (1.0 + _STEP)
    thinner = body.cable_radius * smaller
    truths = {
        "cylinder_diameter": body._replace(rho=radius * smaller + body.cable_radius),
        "cable_diameter": body._replace(rho=radius + thinner, cable_radius=thinner),
        "band_width": body._replace(half_band=body.half_band * smaller),
    }
    found = {name: _seen(view, truth, body, 1.0) for name, truth in truths.items()}
    found["focal_length"] = _seen(view, body, body, smaller)
    right = _seen(view, body, body, 1.0)
    return {
        name: Signature(one.motion - right.motion, one.area - right.area)
        for name, one in found.items()
    }


def _seen(view: CameraView, truth: Body, body: Body, focal: float) -> Signature:
    """Return what a tracker that is configured for one body sees of another.

    Args:
        view: The camera.
        truth: What is there.
        body: As configured.
        focal: True focal length over the configured one.
    """
    azimuths, shares = [], []
    for azimuth in _AZIMUTHS.tolist():
        a, b, area = band_centroid(view, truth, Band(azimuth, 0.0, 0.0))
        start = Band(azimuth, 0.0, 0.0)
        seen, z = solve_band(view, body, focal * a, focal * b, start)
        expected = band_centroid(view, body, start._replace(azimuth=seen, z=z))[2]
        azimuths.append(seen)
        shares.append(focal**2 * area / expected)
    slope = np.polyfit(_AZIMUTHS, azimuths, 1)[0]
    return Signature(float(np.log(slope)), float(np.log(shares).mean()))


def _off(evidence: Evidence, motion: Slope) -> tuple[Signature, Signature] | None:
    """Return how far bands move and how large they are beyond the usual, and both deviations."""
    areas = evidence.area[evidence.area > 0.0]
    if not areas.size:
        return None
    area = float(np.median(np.log(areas)))
    off = Signature(math.log(motion.value) - USUAL.motion, area - USUAL.area)
    return off, Signature(math.hypot(SIGMA.motion, motion.sigma), SIGMA.area)


class _Explanation(NamedTuple):
    """What is left in deviations, for which number, set too large by what share."""

    left: float
    number: str
    share: float
    sigma: float


def _explanations(evidence: Evidence, off: Signature, sigma: Signature) -> list[_Explanation]:
    """Return how well every number alone explains the bands, the best one first."""
    deviations = np.array(sigma)
    scaled = np.array(off) / deviations
    # Of bands that are refused below a size the others seem larger than they are.
    least = off.area + USUAL.area <= math.log(WHOLE_AREA[0]) + SIGMA.area
    found = []
    for name, effect in evidence.effects.items():
        direction = np.array(effect) / deviations
        size = float(np.linalg.norm(direction))
        amount = float(direction @ scaled) / size**2
        left = float(np.linalg.norm(scaled - amount * direction))
        alone = off.motion / effect.motion if effect.motion else math.inf
        if least and abs(0.01 * alone) <= _MOST_SHARE and alone * effect.area <= off.area:
            amount, left = alone, 0.0
        found.append(_Explanation(left, name, 0.01 * amount, 0.01 / size))
    return sorted(found)


def sized_wrongly(evidence: Evidence, motion: Slope) -> bool:
    """Return whether bands have a size that wrong angles and times leave as it is."""
    judged = _off(evidence, motion)
    if judged is None:
        return False
    unsized = abs(judged[0].area) / judged[1].area
    return unsized > _SIZED and _explanations(evidence, *judged)[0].left < unsized - 1.0


def wrong_geometry(evidence: Evidence, passings: list[Passing]) -> Contradiction | None:
    """Judge cylinder, cable and camera by how far bands move, and how large they are."""
    motion = motion_of(passings)
    judged = None if motion is None else _off(evidence, motion)
    if motion is None or judged is None:
        return None
    off = judged[0]
    moved = abs(off.motion) > max(LEAST_MOTION, CHANCE * motion.sigma)
    if not moved and abs(off.area) <= _LEAST_AREA:
        return None
    best, *others = _explanations(evidence, *judged)
    seen = (
        f"bands move {math.exp(off.motion) - 1.0:+.1%} over the picture against the turning and "
        f"their area is {math.exp(off.area) - 1.0:+.0%}"
    )
    if best.left > _EXPLAINED:
        return Contradiction(
            number="geometry",
            share=math.nan,
            sigma=math.nan,
            sentence=f"no single number of cylinder, cable and camera explains it: {seen}",
        )
    as_well = [f", or {_sentence(one)}" for one in others if one.left < best.left + _AS_WELL]
    return Contradiction(
        number=best.number,
        share=best.share,
        sigma=best.sigma,
        sentence=f"{_sentence(best)}{''.join(as_well)}: {seen}",
    )


def _sentence(one: _Explanation) -> str:
    size = size_in_words(one.share)
    if one.number == "focal_length":
        size += f" (or the camera's distance as much too {'small' if one.share > 0.0 else 'large'})"
    return f"the {one.number.replace('_', ' ')} is set {size}"
