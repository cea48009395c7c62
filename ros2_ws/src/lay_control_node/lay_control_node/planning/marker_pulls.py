"""Which pull lands marker n at its angle: more pull, more stretch, less cable per angle, later."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.lay_on import StretchedCable

Array = NDArray[np.float64]

_BISECTIONS = 40
_AT_THE_END = 1.0e-3  # A marker that lands so little after the end lands at the end [rad]


@dataclass(frozen=True, kw_only=True)
class Track:
    """The planned lay that markers land on."""

    t: Array  # Real times [s], not descending, shape (n,)
    theta: Array  # Wound angles [rad], shape (n,)
    slope: Array  # dz/dtheta of the lay [m/rad], shape (n,)
    raised: Array  # Height above cable on the bare cylinder [m], shape (n,)


@dataclass(frozen=True, kw_only=True)
class MarkerLanding:
    """Where a marker is wanted and where it will land."""

    number: int  # n
    wanted: float  # Wound angle [rad]; nan where none is wanted
    predicted: float  # Wound angle [rad]; nan if it does not land by the program's end
    pull: float  # Commanded before it [N]
    earliest: float  # Angle at the smallest pull since the marker before [rad]; nan as above
    latest: float  # Angle at the largest one [rad]; nan as above


@dataclass(frozen=True, kw_only=True)
class PullPlan:
    """Pull over the samples of a track, and what comes of it."""

    commanded: Array  # [N], shape (n,)
    actual: Array  # Of a brake of first order [N], shape (n,)
    landings: tuple[MarkerLanding, ...]  # Of all markers on the cable


class PullPlanner:
    """Plans the pull along a track.

    Args:
        cable: What is laid.
        track: Where.
        given: Pull that the program or the weight asks for [N], shape (n,).
        brake_time: Time constant with which the pull follows [s].
        reach: Smallest and largest pull [N]; None where a dead weight pulls.
    """

    def __init__(
        self,
        cable: StretchedCable,
        track: Track,
        given: Array,
        brake_time: float,
        reach: tuple[float, float] | None,
    ) -> None:
        self._cable = cable
        self._track = track
        self._given = given
        self._brake_time = brake_time
        self._reach = reach

    def plan(self, wanted: dict[int, float]) -> PullPlan:
        """Return the pulls that land markers at wanted angles [rad], as far as they reach."""
        case = self._cable.what.case
        commanded = self._given.copy()
        actual = self._from(commanded, 0, case.weight)
        begin = 0
        reached = {}
        if self._reach is not None:
            for number in sorted(wanted):
                end = int(np.searchsorted(self._track.theta, wanted[number]))
                length = number * case.marker_spacing
                pull, early, late = self._steered(commanded, actual, begin, wanted[number], length)
                reached[number] = (pull, early, late)
                commanded[begin:] = pull
                actual = self._joined(commanded, actual, begin)
                begin = min(end, self._track.theta.size - 1)
        laid = self._laid(actual)
        landings = []
        for number in range(1, case.marker_count + 1):
            angle = self._angle_at(laid, number * case.marker_spacing)
            at = int(np.searchsorted(self._track.theta, angle)) if math.isfinite(angle) else -1
            pull, early, late = reached.get(
                number, (float(commanded[min(at, commanded.size - 1)]), math.nan, math.nan)
            )
            landings.append(
                MarkerLanding(
                    number=number,
                    wanted=wanted.get(number, math.nan),
                    predicted=angle,
                    pull=pull,
                    earliest=early,
                    latest=late,
                )
            )
        return PullPlan(commanded=commanded, actual=actual, landings=tuple(landings))

    def _steered(
        self, commanded: Array, actual: Array, begin: int, angle: float, length: float
    ) -> tuple[float, float, float]:
        """Return what lands a length [m] at an angle [rad], pulled from a sample on.

        That is the pull [N], and the angle at the smallest and at the largest pull [rad].
        """
        assert self._reach is not None
        low, high = self._reach

        def laid_under(pull: float) -> Array:
            trial = commanded.copy()
            trial[begin:] = pull
            return self._laid(self._joined(trial, actual, begin))

        def there(laid: Array) -> float:
            return float(np.interp(angle, self._track.theta, laid))

        slack, tight = laid_under(low), laid_under(high)
        early, late = self._angle_at(slack, length), self._angle_at(tight, length)
        if there(slack) <= length:
            return low, early, late
        if there(tight) >= length:
            return high, early, late
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if there(laid_under(middle)) > length:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high), early, late

    def _joined(self, commanded: Array, actual: Array, begin: int) -> Array:
        """Return the pull with that from a sample on anew [N], shape (n,)."""
        after = self._from(commanded[begin:], begin, float(actual[begin]))
        return np.concatenate([actual[:begin], after])

    def _from(self, commanded: Array, begin: int, start: float) -> Array:
        """Return the pull of the brake [N] from a sample and a pull [N] on, shape (m,)."""
        if self._brake_time == 0.0 or self._reach is None:
            return commanded.copy()
        kept = np.exp(-np.diff(self._track.t[begin:]) / self._brake_time)
        if (commanded == commanded[0]).all():
            since = (self._track.t[begin:] - self._track.t[begin]) / self._brake_time
            return np.asarray(commanded + (start - commanded) * np.exp(-since))
        pull, found = start, [start]
        for share, wanted in zip(kept.tolist(), commanded[:-1].tolist(), strict=True):
            pull = wanted + (pull - wanted) * share
            found.append(pull)
        return np.array(found)

    def _laid(self, actual: Array) -> Array:
        """Return the undeformed cable laid so far [m], shape (n,)."""
        track = self._track
        rate = self._cable.per_radian(actual, track.theta, track.slope, track.raised)
        pieces = 0.5 * (rate[1:] + rate[:-1]) * np.diff(track.theta)
        return np.concatenate([[0.0], np.cumsum(pieces)])

    def _angle_at(self, laid: Array, length: float) -> float:
        theta = self._track.theta
        short = length - float(laid[-1])
        if short <= 0.0:
            return float(np.interp(length, laid, theta))
        # What is wanted at the very end may miss it by a rounding.
        beyond = short * float((theta[-1] - theta[0]) / laid[-1])
        return float(theta[-1]) + beyond if beyond < _AT_THE_END else math.nan
