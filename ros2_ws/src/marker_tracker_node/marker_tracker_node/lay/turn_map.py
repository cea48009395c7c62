"""Where every part of the wound cable was seen to lie, by its wound angle."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.lay.config import Machine
from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]

PLACES_PER_TURN = 72
PLACE_ANGLE = 2.0 * math.pi / PLACES_PER_TURN
BEFORE = PLACES_PER_TURN // 2  # Places before P0, for the clamped tail
MEMORY = 60.0  # A mean forgets what is older than so many sightings: cable may slip
LED = 2.0  # How far the guide leads the newest cable on from where it was seen [rad]


class Places(NamedTuple):
    """Means of what was seen of the cable, by wound angle in places of 5 degrees."""

    # Mean at the middle of each place, as of cable on the cylinder [m]; nan where unseen.
    z: FloatArray
    weight: FloatArray  # Sum of the weights, 1 / variance [1/m^2]
    sightings: FloatArray  # How often each was seen
    whole: FloatArray  # Share of sightings in which nothing lay on it
    steep: FloatArray  # Mean steepness of the rays, see `RowTables`
    floor: FloatArray  # Mean of the error that does not average out [m]
    spread: FloatArray  # Mean square of what sightings are off the mean [m^2]


class TurnMap:
    """Where every part of the wound cable was seen, with room for more of it."""

    def __init__(self) -> None:
        self.places = _room(16 * PLACES_PER_TURN)  # By wound angle

    @staticmethod
    def place_of(theta: float) -> int:
        """Return the place of a wound angle [rad]; negative for cable that is not kept."""
        return math.floor(theta / PLACE_ANGLE) + BEFORE

    def reserve(self, theta: float) -> None:
        """Make room for cable up to a wound angle [rad]."""
        old, size = self.places, self.places.z.size
        if self.place_of(theta) < size:
            return
        while self.place_of(theta) >= size:
            size *= 2
        self.places = _room(size)
        for before, after in zip(old, self.places, strict=True):
            after[: before.size] = before

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
        """Take a sighting, see `add_sighting`."""
        self.reserve(theta)
        add_sighting(self.places, theta, z, slope, sigma, floor, whole, steep)

    def lies_on_others(self, theta: float, z: float, limit: float) -> bool:
        """Return whether turns before a wound angle [rad] lie nearer to z than a limit [m]."""
        before = self.places.z[self.place_of(theta) % PLACES_PER_TURN : self.place_of(theta)]
        return bool((np.abs(before[::PLACES_PER_TURN] - z) < limit).any())

    def near(self, theta: float, reach: float, slope: float) -> float:
        """Return z [m] expected at a wound angle, see `expected_near`."""
        return expected_near(self.places, theta, reach, slope)


def _room(size: int) -> Places:
    z = np.full(size, np.nan)
    return Places(z, *(np.zeros(size) for _ in range(len(Places._fields) - 1)))


@called
def _theta_of(place: int) -> float:  # pragma: no cover
    return (place - BEFORE + 0.5) * PLACE_ANGLE


@called
def _seen(places: Places, place: int, way: int, most: int) -> int:  # pragma: no cover
    """Return the first place that was seen from one on, -1 for none."""
    for k in range(place, place + way * (most + 1), way):
        if 0 <= k < places.z.size and places.sightings[k] > 0.0:
            return k
    return -1


@compiled
def add_sighting(
    places: Places,
    theta: float,
    z: float,
    slope: float,
    sigma: float,
    floor: float,
    whole: bool,
    steep: float,
) -> None:  # pragma: no cover
    """Take a sighting; one that is farther on than there is room for is left out.

    Args:
        places: What is known.
        theta: Wound angle [rad].
        z: [m]
        slope: dz/dtheta there [m/rad].
        sigma: Of its scatter [m].
        floor: Error that does not average out [m].
        whole: Whether nothing lies on it.
        steep: Of the ray, see `RowTables`.
    """
    place = math.floor(theta / PLACE_ANGLE) + BEFORE
    if not 0 <= place < places.z.size:
        return
    count = places.sightings[place]
    if count > 0.0 and not whole and places.whole[place] > 0.5:
        # It was seen better before others came to lie on it.
        return
    z -= slope * (theta - _theta_of(place))
    kept = min(count, MEMORY)
    weight = places.weight[place] * (kept / count) if count > 0.0 else 0.0
    added = 1.0 / (sigma * sigma)
    total = weight + added
    share = added / total
    off = z - places.z[place] if weight > 0.0 else 0.0
    places.z[place] = z if weight == 0.0 else places.z[place] + share * off
    places.spread[place] += share * ((1.0 - share) * off * off - places.spread[place])
    places.weight[place] = total
    places.sightings[place] = kept + 1.0
    places.whole[place] += share * ((1.0 if whole else 0.0) - places.whole[place])
    places.steep[place] += share * (steep - places.steep[place])
    places.floor[place] += share * (floor - places.floor[place])


@compiled
def expected_near(
    places: Places, theta: float, reach: float, slope: float
) -> float:  # pragma: no cover
    """Return z [m] expected at a wound angle from what was seen nearby, nan for nothing.

    Args:
        places: What is known.
        theta: Wound angle [rad].
        reach: How far it may be carried on [rad].
        slope: dz/dtheta with which it is carried on where only one side is known [m/rad].
    """
    middle = math.floor(theta / PLACE_ANGLE) + BEFORE
    most = math.ceil(reach / PLACE_ANGLE)
    below = _seen(places, middle, -1, most)
    above = _seen(places, middle + 1, 1, most)
    if below < 0 and above < 0:
        return math.nan
    z = places.z
    if below >= 0 and above >= 0:
        share = (theta - _theta_of(below)) / ((above - below) * PLACE_ANGLE)
        return float(z[below] + share * (z[above] - z[below]))
    known = max(below, above)
    further = known - 3 if known == below else known + 3
    if 0 <= further < z.size and places.sightings[further] > 0.0:
        slope = (z[known] - z[further]) / ((known - further) * PLACE_ANGLE)
    return float(z[known] + slope * (theta - _theta_of(known)))


@compiled
def unseen_for(places: Places, theta: float, most: float) -> float:  # pragma: no cover
    """Return the way from a wound angle to the nearest that was seen, at most so much [rad].

    Args:
        places: What is known.
        theta: Wound angle [rad].
        most: How far is looked [rad].
    """
    middle = math.floor(theta / PLACE_ANGLE) + BEFORE
    for k in range(math.ceil(most / PLACE_ANGLE)):
        for place in (middle - k, middle + k):
            if 0 <= place < places.z.size and places.sightings[place] > 0.0:
                return min(abs(theta - _theta_of(place)), most)
    return most


@compiled
def led_on(
    places: Places, theta: float, guide: float, machine: Machine
) -> float:  # pragma: no cover
    """Return z [m] of the newest cable, led by the guide from where it was seen last.

    A straight span makes z + L z' = guide, z' being the rise per way.

    Args:
        places: What is known.
        theta: Wound angle [rad].
        guide: z of the guide [m].
        machine: Cylinder, cable and span.

    Returns:
        nan where the guide or cable within LED is unknown, or where newer cable has been seen.
    """
    middle = math.floor(theta / PLACE_ANGLE) + BEFORE
    most = math.ceil(LED / PLACE_ANGLE)
    if not math.isfinite(guide) or _seen(places, middle + 1, 1, most) >= 0:
        return math.nan
    last = _seen(places, middle, -1, most)
    if last < 0:
        return math.nan
    way = (theta - _theta_of(last)) * machine.rho
    return float(guide + (places.z[last] - guide) * math.exp(-way / machine.free_length))
