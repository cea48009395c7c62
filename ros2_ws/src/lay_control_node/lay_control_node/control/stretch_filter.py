"""How much of the pull at the guide reaches the cylinder, from where markers have landed."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.lay_on import LayOnLaw

Array = NDArray[np.float64]

# Steps of the wound angle over which tension and slope are taken as constant [rad].
_STEP = 0.02
_ITERATIONS = 4
# What share, drag [N], start and build-up length [m] may be, and by how much they are moved for a
# derivative.
_LOW, _HIGH = (0.05, -2.0, 0.0, 0.02), (2.0, 5.0, 1.5, 2.0)
_CHANGE = 1.0e-3
# An equation further off than this many deviations counts as a bad one and is given less weight.
_OUTLYING = 3.0


@dataclass(frozen=True, kw_only=True)
class StretchFilterConfig:
    """Prior of the tension at lay-on before a marker has landed."""

    share: float = 0.7  # Share of the pull at the guide that reaches the cylinder
    sigma_share: float = 0.15  # One standard deviation of it
    drag: float = 0.15  # Constant addition of the guide [N]
    sigma_drag: float = 0.1  # One standard deviation of it [N]
    start: float = 1.0  # Share of the tension at the start of the build-up
    sigma_start: float = 0.1  # One standard deviation of it
    build_up: float = 0.255  # Wound length over which the tension builds up from its start [m]
    sigma_build_up: float = 0.075  # One standard deviation of it [m]
    drift_share: float = 0.01  # Change of the share from marker to marker, one standard deviation
    model_error: float = 7.0e-4  # What the closed form leaves out of a segment's length, relative
    # What the law leaves out of the tension, relative: a brake's own friction.
    tension_error: float = 0.04


@dataclass(frozen=True, kw_only=True)
class StretchEstimate:
    """The tension at lay-on as (share pull + drag) (start + (1 - start)(1 - exp(-s / L_c)))."""

    share: float  # Share of the pull at the guide
    drag: float  # Constant addition [N]
    start: float  # Share of the tension at the start of the build-up
    build_up_length: float  # L_c [m] of wound cable
    covariance: Array  # Of share, drag, start and build-up length, shape (4, 4)

    @property
    def mean(self) -> Array:
        """Share, drag [N], start and build-up length [m], shape (4,)."""
        return np.array([self.share, self.drag, self.start, self.build_up_length])

    @classmethod
    def of(cls, mean: Array, covariance: Array) -> Self:
        """Return the law of a mean (4,) and its covariance (4, 4)."""
        share, drag, start, build_up = map(float, mean)
        return cls(
            share=share, drag=drag, start=start, build_up_length=build_up, covariance=covariance
        )

    def moved(self, change: Array) -> Self:
        """Return the law with the mean moved by a change (4,), as far as such a rig can be."""
        return self.of(np.clip(self.mean + change, _LOW, _HIGH), self.covariance)

    def built(self, wound: float | Array) -> Array:
        """Return the share of the tension that has built up after wound lengths [m]."""
        left = np.exp(-np.maximum(wound, 0.0) / self.build_up_length)
        return np.asarray(1.0 - (1.0 - self.start) * left)

    def tension(self, pull: float | Array, wound: float | Array) -> Array:
        """Return the tension at lay-on [N] under pulls [N] after wound lengths [m]."""
        final = np.maximum(self.share * np.asarray(pull) + self.drag, 0.0)
        return np.asarray(self.built(wound) * final)


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far the cable has been laid."""

    theta: float  # Wound angle [rad]
    laid: float  # Undeformed length from P0 [m]
    landed: int  # Newest marker that was measured


class StretchFilter:
    """Estimates the tension at lay-on from the undeformed length between landed markers.

    Between two markers lies one spacing of undeformed cable, laid at `LayOnLaw.density` over the
    angle between them. An iterated extended Kalman filter takes one such equation per marker.

    Args:
        law: Lay-on of the cable.
        spacing: Undeformed cable between markers [m].
        radius: Centreline radius R + r [m].
        config: The prior.
    """

    def __init__(
        self,
        law: LayOnLaw,
        *,
        spacing: float,
        radius: float,
        config: StretchFilterConfig | None = None,
    ) -> None:
        config = config or StretchFilterConfig()
        self.config = config
        self._law, self._spacing, self._radius = law, spacing, radius
        self._mean = np.array([config.share, config.drag, config.start, config.build_up])
        sigmas = (config.sigma_share, config.sigma_drag, config.sigma_start, config.sigma_build_up)
        self._covariance = np.diag(np.square(sigmas))
        # End angle, pull [N], slope [m/rad] of every step since the last landed marker.
        self._steps: list[tuple[float, float, float]] = []
        self._from = 0.0
        self._sigma_from = 0.0
        self._joined = False
        self.landed = 0

    @property
    def estimate(self) -> StretchEstimate:
        """Estimate now."""
        return self._estimate_of(self._mean)

    def join(self, theta: float) -> None:
        """Begin in mid-run at a wound angle [rad]: the next marker shows how much is laid."""
        self._steps.clear()
        self._from, self._joined = theta, True

    @property
    def known(self) -> bool:
        """Whether it is known how much cable has been laid."""
        return not self._joined

    def advance(self, theta: float, pull: float, slope: float) -> None:
        """Note the pull at the guide [N] and dz/dtheta [m/rad] under which cable lands at theta."""
        last = self._steps[-1][0] if self._steps else self._from
        if theta >= last + _STEP:
            self._steps.append((theta, pull, slope))

    def laid(self, estimate: StretchEstimate | None = None) -> float:
        """Return the undeformed length laid since the newest marker that was taken [m]."""
        return self._length(self._steps, estimate or self.estimate)

    def progress(self, theta: float) -> Progress:
        """Return how far the cable has been laid at a wound angle [rad]."""
        laid = self.landed * self._spacing + self.laid()
        return Progress(theta=theta, laid=laid, landed=self.landed)

    def land(self, number: int, theta: float, sigma: float) -> None:
        """Take where marker `number` lies: wound angle and its deviation [rad].

        A marker that is not ahead of the last one taken is passed over. One that was missed
        makes the segment as many spacings long.
        """
        count = number - self.landed
        if self._joined and theta > self._from:
            self._keep_after(theta)
            self._sigma_from, self.landed, self._joined = sigma, number, False
            return
        if count < 1 or theta <= self._from or not self._steps:
            return
        steps = [step for step in self._steps if step[0] < theta]
        following = next((step for step in self._steps if step[0] >= theta), self._steps[-1])
        steps.append((theta, *following[1:]))
        self._update(steps, count, sigma)
        self._keep_after(theta)
        self._sigma_from, self.landed = sigma, number

    def _keep_after(self, theta: float) -> None:
        self._steps = [step for step in self._steps if step[0] > theta]
        self._from = theta

    def _update(self, steps: list[tuple[float, float, float]], count: int, sigma: float) -> None:
        config = self.config
        wanted = count * self._spacing
        covariance = self._covariance + np.diag([config.drift_share**2, 0.0, 0.0, 0.0])
        angle = steps[-1][0] - self._from
        noise = (wanted / angle) ** 2 * (sigma**2 + self._sigma_from**2)
        length, row = self._linearised(steps, self._mean)
        # The stretch goes with the tension, as far as a cable's law is straight.
        stretched = max(self._radius * angle / length - 1.0, 0.0)
        noise += wanted**2 * (config.model_error**2 + (config.tension_error * stretched) ** 2)
        spread = row @ covariance @ row
        off = (wanted - length) ** 2 / (spread + noise)
        if off > _OUTLYING**2:
            noise = (wanted - length) ** 2 / _OUTLYING**2 - spread
        prior, mean, gain = self._mean, self._mean, np.zeros(4)
        for _ in range(_ITERATIONS):
            length, row = self._linearised(steps, mean)
            gain = covariance @ row / (row @ covariance @ row + noise)
            mean = prior + gain * (wanted - length - row @ (prior - mean))
            mean = np.clip(mean, _LOW, _HIGH)
        self._mean = mean
        self._covariance = covariance - np.outer(gain, row @ covariance)

    def _linearised(
        self, steps: list[tuple[float, float, float]], mean: Array
    ) -> tuple[float, Array]:
        """Return the length [m] of steps under a mean (4,) and its derivatives (4,)."""
        length = self._length(steps, self._estimate_of(mean))
        row = np.empty(mean.size)
        for index in range(mean.size):
            moved = mean.copy()
            moved[index] += _CHANGE
            row[index] = (self._length(steps, self._estimate_of(moved)) - length) / _CHANGE
        return length, row

    def _estimate_of(self, mean: Array) -> StretchEstimate:
        return StretchEstimate.of(mean, self._covariance.copy())

    def _length(self, steps: list[tuple[float, float, float]], estimate: StretchEstimate) -> float:
        if not steps:
            return 0.0
        theta, pull, slope = np.array(steps).T
        wide = np.diff(theta, prepend=self._from)
        tension = estimate.tension(pull, self._radius * (theta - 0.5 * wide))
        return float(np.sum(self._law.density(tension, slope) * wide))
