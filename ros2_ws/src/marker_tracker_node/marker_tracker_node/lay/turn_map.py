"""Where every part of the wound cable was seen to lie, by its wound angle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

PLACES_PER_TURN = 72
PLACE_ANGLE = 2.0 * math.pi / PLACES_PER_TURN
# Places before P0, for the clamped tail.
BEFORE = PLACES_PER_TURN // 2
# A mean forgets what is older than so many sightings: cable may slip.
MEMORY = 60.0


class TurnMap:
    """Means of what was seen of the cable, by wound angle in places of 5 degrees.

    Attributes:
        z: Mean at the middle of each place, as of cable on the cylinder [m]; nan where unseen.
        weight: Sum of the weights, 1 / variance [1/m^2].
        count: Sightings.
        whole: Share of sightings in which nothing lay on it.
        steep: Mean steepness of the rays, see `RowTable`.
        floor: Mean of the error that does not average out [m].
    """

    def __init__(self) -> None:
        self._allocate(16 * PLACES_PER_TURN)

    def _allocate(self, size: int) -> None:
        self.z = np.full(size, np.nan)
        self.weight, self.count, self.whole, self.steep, self.floor = (
            np.zeros(size) for _ in range(5)
        )

    @staticmethod
    def theta_of(place: int) -> float:
        """Return the wound angle of the middle of a place [rad]."""
        return (place - BEFORE + 0.5) * PLACE_ANGLE

    @staticmethod
    def place_of(theta: float) -> int:
        """Return the place of a wound angle [rad]; negative for cable that is not kept."""
        return math.floor(theta / PLACE_ANGLE) + BEFORE

    def add(
        self,
        theta: float,
        z: float,
        *,
        slope: float,
        sigma: float,
        floor: float,
        whole: bool,
        steep: float,
    ) -> None:
        """Take a sighting.

        Args:
            theta: Wound angle [rad].
            z: [m]
            slope: dz/dtheta there [m/rad].
            sigma: Of its scatter [m].
            floor: Error that does not average out [m].
            whole: Whether nothing lies on it.
            steep: Of the ray, see `RowTable`.
        """
        place = self.place_of(theta)
        if place < 0:
            return
        while place >= self.z.size:
            self._grow()
        if self.count[place] and not whole and self.whole[place] > 0.5:
            # It was seen better before others came to lie on it.
            return
        z -= slope * (theta - self.theta_of(place))
        added = 1.0 / (sigma * sigma)
        kept = min(self.count[place], MEMORY)
        weight = self.weight[place] * (kept / self.count[place] if self.count[place] else 0.0)
        total = weight + added
        share = added / total
        self.z[place] = z if weight == 0.0 else self.z[place] + share * (z - self.z[place])
        self.weight[place] = total
        self.count[place] = kept + 1.0
        for mean, value in ((self.whole, float(whole)), (self.steep, steep), (self.floor, floor)):
            mean[place] += share * (value - mean[place])

    def near(self, theta: float, reach: float, slope: float) -> float:
        """Return z [m] expected at a wound angle from what was seen nearby, nan for nothing.

        Args:
            theta: Wound angle [rad].
            reach: How far it may be carried on [rad].
            slope: dz/dtheta with which it is carried on where only one side is known [m/rad].
        """
        middle = self.place_of(theta)
        most = math.ceil(reach / PLACE_ANGLE)
        below = self._seen(middle, -1, most)
        above = self._seen(middle + 1, 1, most)
        if below < 0 and above < 0:
            return math.nan
        if below >= 0 and above >= 0:
            share = (theta - self.theta_of(below)) / ((above - below) * PLACE_ANGLE)
            return float(self.z[below] + share * (self.z[above] - self.z[below]))
        known = max(below, above)
        further = known - 3 if known == below else known + 3
        if 0 <= further < self.z.size and self.count[further]:
            slope = (self.z[known] - self.z[further]) / ((known - further) * PLACE_ANGLE)
        return float(self.z[known] + slope * (theta - self.theta_of(known)))

    def _seen(self, place: int, way: int, most: int) -> int:
        for k in range(place, place + way * (most + 1), way):
            if 0 <= k < self.z.size and self.count[k]:
                return k
        return -1

    def _grow(self) -> None:
        old = (self.z, self.weight, self.count, self.whole, self.steep, self.floor)
        self._allocate(2 * self.z.size)
        new = (self.z, self.weight, self.count, self.whole, self.steep, self.floor)
        for before, after in zip(old, new, strict=True):
            after[: before.size] = before
