"""Which markers have landed, and where: the mean of the first frames that agree."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from winding_core.markers import Markers

# Frames without a flag that a marker is averaged over.
_FRAMES = 20
# How far their angles may spread: so much [rad], or so many of their own deviations where these
# are larger. Of 20 frames of a marker that lies, one set in a hundred spreads further than 5.7.
_SPREAD = 8.0e-3
_DEVIATIONS = 5.7
# Part of the error that all frames of a marker have in common: [rad] and [m].
_COMMON_ANGLE = 1.0e-3
_COMMON_HEIGHT = 3.0e-5


@dataclass(frozen=True, kw_only=True)
class LandedMarker:
    """Where a marker lies.

    Attributes:
        number: Of the marker.
        theta: Wound angle [rad].
        z: Height [m].
        sigma_theta: One standard deviation of theta [rad].
        sigma_z: One standard deviation of z [m].
    """

    number: int
    theta: float
    z: float
    sigma_theta: float
    sigma_z: float


class LandedMarkers:
    """Averages tracked markers frame by frame, and tells each one once."""

    def __init__(self) -> None:
        self._frames: dict[int, list[list[float]]] = {}
        self._told: set[int] = set()

    def take(self, markers: Markers) -> Iterator[LandedMarker]:
        """Take the markers of a frame; yield those that have landed with it, in order.

        A record with a number that is not finite is passed over.
        """
        for record in np.sort(markers[markers["flags"] == 0], order="id"):
            number = int(record["id"])
            if number == 0 or number in self._told:
                continue
            frame = [float(record[n]) for n in ("theta", "z", "sigma_theta", "sigma_z")]
            if not all(map(math.isfinite, frame)):
                continue
            frames = self._frames.setdefault(number, [])
            frames.append(frame)
            if len(frames) < _FRAMES:
                continue
            theta, _, sigma, _ = np.array(frames).T
            if np.ptp(theta) > max(_SPREAD, _DEVIATIONS * float(np.median(sigma))):
                # It moves, or one of the frames is wrong: the oldest one is the first to go.
                frames.pop(0)
                continue
            self._told.add(number)
            yield _mean(number, frames)


def _mean(number: int, frames: list[list[float]]) -> LandedMarker:
    theta, z, sigma_theta, sigma_z = np.mean(frames, axis=0)
    share = 1.0 / math.sqrt(len(frames))
    return LandedMarker(
        number=number,
        theta=float(theta),
        z=float(z),
        sigma_theta=math.hypot(float(sigma_theta) * share, _COMMON_ANGLE),
        sigma_z=math.hypot(float(sigma_z) * share, _COMMON_HEIGHT),
    )
