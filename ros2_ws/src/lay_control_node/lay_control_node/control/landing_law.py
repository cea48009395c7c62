"""The pull under which the next markers land where they are wanted."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lay_control_node.control.guide_law import WantedLay
from lay_control_node.control.stretch_filter import Progress, StretchEstimate
from lay_control_node.planning.lay_on import LayOnLaw

Array = NDArray[np.float64]

_LATE = 0.3  # A marker that lands within this is late: the pull is for those behind it [rad]
_AHEAD = 3  # How many markers ahead the pull is planned for
# Pieces of the plan and of its integral [rad].
_PIECE, _STEP = 1.5, 0.1
_ITERATIONS = 3
# Angle that a change of the pull at its limit is worth, so that none is made without use [rad].
_EFFORT = 0.005
_RENEWED = 0.5  # A plan is made anew after this angle [rad]


@dataclass(frozen=True, kw_only=True)
class PullBounds:
    """What may be commanded of the brake.

    A pull that changes by less than the friction coefficient mu per radian, on a logarithmic scale,
    moves nothing that lies: T(phi) stays within F exp(-mu phi) and F exp(mu phi) everywhere. One
    that changes a little faster moves the newest turn by little: at 1.4 mu the rod's markers of the
    paper's cases that had landed moved by less than 0.1 % of a turn, at 2 mu the next one missed
    by 3 % in a soft cable.
    """

    low: float  # Smallest pull [N]
    high: float  # Largest pull [N]
    per_radian: float  # Largest change of ln(pull) per wound angle [1/rad]

    def __post_init__(self) -> None:
        if not 0.0 < self.low < self.high:
            raise ValueError(
                f"the largest pull must exceed the smallest, and that 0 N, "
                f"got {self.low:g} to {self.high:g} N"
            )

    def within(self, pull: float) -> float:
        """Return the nearest pull of the range [N]."""
        return min(max(pull, self.low), self.high)


class LandingLaw:
    """Plans the pull over the angle up to the next wanted markers, again and again.

    The plan is ln(pull), linear in pieces of the wound angle, with slopes that keep `PullBounds`.
    It has the smallest sum of squares of the angles by which the next three markers miss, found
    by Gauss and Newton's method with bounds.

    Args:
        law: Lay-on of the cable.
        spacing: Undeformed cable between markers [m].
        radius: Centreline radius R + r [m].
        markers: Wanted wound angle [rad] by marker.
        wanted: The lay, for its slope.
        bounds: Of the pull.

    Attributes:
        law: Lay-on of the cable.
        spacing: Undeformed cable between markers [m].
        bounds: Of the pull.
        expected: Angle by which each marker of the plan will miss [rad], by marker.
    """

    def __init__(
        self,
        law: LayOnLaw,
        *,
        spacing: float,
        radius: float,
        markers: Mapping[int, float],
        wanted: WantedLay,
        bounds: PullBounds,
    ) -> None:
        self.law, self._radius, self._wanted = law, radius, wanted
        self.spacing, self.bounds = spacing, bounds
        self._markers = dict(sorted(markers.items()))
        self._plan: tuple[Array, Array] | None = None
        self._planned_at = -math.inf
        self._planned_with = -1
        self.expected: dict[int, float] = {}

    def pull(
        self, progress: Progress, estimate: StretchEstimate, pull: float, *, free: bool
    ) -> float:
        """Return the pull [N] to command now.

        Args:
            progress: How far the cable has been laid; a plan is made anew for each landed marker.
            estimate: Of the tension at lay-on.
            pull: What was commanded last [N].
            free: Whether so little lies that a step of the pull moves nothing.
        """
        theta = progress.theta
        aims = self._aims(progress)
        if not aims:
            return pull
        if free:
            pull = self._level(progress, estimate, aims)
        plan = self._plan
        if (
            plan is None
            or progress.landed != self._planned_with
            or theta > self._planned_at + _RENEWED
        ):
            plan = self._plan = self._renewed(progress, estimate, pull, aims)
            self._planned_at, self._planned_with = theta, progress.landed
        return self.bounds.within(math.exp(float(np.interp(theta, *plan))))

    def _aims(self, progress: Progress) -> dict[int, float]:
        ahead = {
            number: angle
            for number, angle in self._markers.items()
            if angle - progress.theta > _LATE and number * self.spacing > progress.laid
        }
        return dict(list(ahead.items())[:_AHEAD])

    def _level(
        self, progress: Progress, estimate: StretchEstimate, aims: Mapping[int, float]
    ) -> float:
        """Return the constant pull [N] that brings the first of the markers to its place."""
        number, angle = next(iter(aims.items()))
        low, high = self.bounds.low, self.bounds.high
        grid, slope = self._grid(progress.theta, angle)
        for _ in range(40):
            middle = math.sqrt(low * high)
            level = np.full(grid.shape, math.log(middle))
            laid = self._laid(grid, slope, level, estimate)[-1]
            if progress.laid + laid > number * self.spacing:
                low = middle
            else:
                high = middle
        return low

    def _renewed(
        self, progress: Progress, estimate: StretchEstimate, pull: float, aims: Mapping[int, float]
    ) -> tuple[Array, Array]:
        """Return angles [rad] and ln(pull) of a new plan, which begins where the old one is."""
        from scipy.optimize import lsq_linear  # noqa: PLC0415

        theta = progress.theta
        last = max(aims.values())
        knots = np.linspace(theta, last, max(2, math.ceil((last - theta) / _PIECE) + 1))
        wide = np.diff(knots)
        most = self.bounds.per_radian
        grid, slope = self._grid(theta, last)
        low, high = math.log(self.bounds.low), math.log(self.bounds.high)
        angles = np.array(list(aims.values()))
        wanted = self.spacing * np.array(list(aims)) - progress.laid
        if self._plan is None:
            slopes = np.zeros(wide.size)
        else:
            slopes = np.clip(np.diff(np.interp(knots, *self._plan)) / wide, -most, most)

        def plan(tried: Array) -> Array:
            level = math.log(pull) + np.concatenate([[0.0], np.cumsum(tried * wide)])
            return np.clip(level, low, high)

        def missed(tried: Array) -> Array:
            """Return by which angle each marker lands after its place [rad]."""
            laid = self._laid(grid, slope, np.interp(grid, knots, plan(tried)), estimate)
            density = laid[-1] / (grid[-1] - theta)
            return np.asarray((wanted - np.interp(angles, grid, laid)) / density)

        effort = np.diag(np.full(wide.size, _EFFORT / most))
        miss = missed(slopes)
        for _ in range(_ITERATIONS):
            steps = np.full(wide.size, 0.02 * most)
            steps[slopes > 0.0] *= -1.0
            jacobian = np.stack(
                [
                    (missed(slopes + steps[k] * (np.arange(wide.size) == k)) - miss) / steps[k]
                    for k in range(wide.size)
                ],
                axis=1,
            )
            found = lsq_linear(
                np.concatenate([jacobian, effort]),
                np.concatenate([jacobian @ slopes - miss, np.zeros(wide.size)]),
                bounds=(-most, most),
            )
            tried = np.clip(found.x, -most, most)
            trial = missed(tried)
            if trial @ trial >= miss @ miss:
                break
            slopes, miss = tried, trial
        self.expected = dict(zip(aims, miss.tolist(), strict=True))
        return knots, plan(slopes)

    def _grid(self, theta: float, last: float) -> tuple[Array, Array]:
        """Return angles from one to another [rad] and dz/dtheta wanted there [m/rad]."""
        grid = np.linspace(theta, last, max(2, math.ceil((last - theta) / _STEP) + 1))
        return grid, self._wanted.slopes(grid)

    def _laid(self, grid: Array, slope: Array, level: Array, estimate: StretchEstimate) -> Array:
        """Return the undeformed length laid from the first angle on [m], shape of the grid (n,)."""
        tension = estimate.tension(np.exp(level), self._radius * grid)
        density = self.law.density(tension, slope)
        pieces = 0.5 * (density[1:] + density[:-1]) * np.diff(grid)
        return np.concatenate([[0.0], np.cumsum(pieces)])
