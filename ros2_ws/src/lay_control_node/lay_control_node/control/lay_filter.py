"""Where the cable lands now: a Kalman filter over the wound angle, fed by what the camera saw."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Steps of the wound angle between which the guide is taken as moving evenly [rad].
_STEP = 0.01
Z, LENGTH, OFFSET = range(3)


@dataclass(frozen=True, kw_only=True)
class LayFilterConfig:
    """What is believed before anything has landed, and how much it may drift.

    Attributes:
        radius: Centreline radius R + r [m].
        free_length: Tangent span between cylinder and guide, as believed [m].
        sigma_length: One standard deviation of that belief [m].
        sigma_offset: Of the place of the cable's eye against the carriage's reading [m].
        drift_z: Of what the law of the lag leaves out, per square root of a radian [m].
        drift_length: Of the effective free length, per square root of a radian [m].
        drift_offset: Of the eye's place, per square root of a radian [m].
        play: Play of the eye on its carriage [m]; the eye is somewhere in it after a reversal.
        correlated: Part of a measured height that its neighbours have in common [m].
    """

    radius: float
    free_length: float
    sigma_length: float = 0.02
    sigma_offset: float = 3.0e-4
    drift_z: float = 3.0e-5
    drift_length: float = 1.0e-3
    drift_offset: float = 3.0e-5
    play: float = 3.0e-4
    correlated: float = 3.0e-5

    def __post_init__(self) -> None:
        for name in ("radius", "free_length", "sigma_length", "sigma_offset"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive, got {value} m")


@dataclass(frozen=True, kw_only=True)
class LayEstimate:
    """The lay at the contact line.

    Attributes:
        theta: Wound angle [rad].
        z: Where the cable lands [m].
        free_length: Effective length of the span [m].
        offset: Place of the eye beside the carriage's reading [m].
        covariance: Of z, free length and offset [m^2], shape (3, 3).
    """

    theta: float
    z: float
    free_length: float
    offset: float
    covariance: Array

    @property
    def sigma_z(self) -> float:
        """One standard deviation of z [m]."""
        return math.sqrt(self.covariance[Z, Z])

    @property
    def sigma_length(self) -> float:
        """One standard deviation of the free length [m]."""
        return math.sqrt(self.covariance[LENGTH, LENGTH])


@dataclass(kw_only=True)
class _State:
    """Mean (3,), covariance (3, 3), wound angle [rad] and guide [m] up to which they hold."""

    mean: Array
    covariance: Array
    theta: float
    guide: float
    heading: float = 0.0


class LayFilter:
    """Estimates z at the contact line with free length and eye offset, from delayed heights.

    The state is z, L and b with dz/dTheta = (g + b - z) (R + r) / L, an extended Kalman filter in
    the wound angle: a standing cylinder lays nothing. Two states are kept. One stands where the
    last measured height is and moves on with the next; the other is that state carried on to the
    present along the guide's way since.

    Args:
        config: What is believed before.
    """

    def __init__(self, config: LayFilterConfig) -> None:
        self.config = config
        variances = (1.0e-10, config.sigma_length**2, config.sigma_offset**2)
        self._seen = _State(
            mean=np.array([0.0, config.free_length, 0.0]),
            covariance=np.diag(variances),
            theta=0.0,
            guide=0.0,
        )
        self._now = self._copied(self._seen)
        self._since: deque[tuple[float, float]] = deque()

    def advance(self, theta: float, guide: float) -> None:
        """Carry the estimate on to a wound angle [rad] at which the carriage reads `guide` [m].

        Angles that are not ahead are passed over: a cylinder that turns back lays nothing.
        """
        if theta < self._now.theta + _STEP:
            if theta <= self._now.theta:
                self._now.guide = guide
            return
        self._carry(self._now, theta, guide)
        self._since.append((theta, guide))

    def measure(self, theta: float, z: float, sigma: float) -> float | None:
        """Take the height z [m] of cable at a wound angle [rad] with its deviation [m].

        Returns:
            Its innovation in standard deviations; None where it says nothing new, because cable
            further on has been measured already or this has not been laid yet.
        """
        seen = self._seen
        if not (seen.theta < theta <= self._now.theta and math.isfinite(z) and sigma > 0.0):
            return None
        while self._since and self._since[0][0] <= theta:
            self._carry(seen, *self._since.popleft())
        if self._since:
            self._carry(seen, theta, self._between(theta))
        column = seen.covariance[:, Z]
        spread = column[Z] + sigma**2 + self.config.correlated**2
        innovation = z - seen.mean[Z]
        score = float(innovation / math.sqrt(spread))
        gain = column / spread
        seen.mean = seen.mean + gain * innovation
        seen.covariance = seen.covariance - np.outer(gain, column)
        self._bound(seen)
        self._now = self._copied(seen)
        for place in self._since:
            self._carry(self._now, *place)
        return score

    @property
    def measured_to(self) -> float:
        """Wound angle up to which cable has been measured [rad]."""
        return self._seen.theta

    def estimate(self, ahead: float = 0.0, guide: float | None = None) -> LayEstimate:
        """Return the lay now, or an angle `ahead` [rad] with the carriage at `guide` [m] then."""
        state = self._now
        if ahead > 0.0:
            state = self._copied(state)
            self._carry(state, state.theta + ahead, state.guide if guide is None else guide)
        z, length, offset = map(float, state.mean)
        return LayEstimate(
            theta=state.theta,
            z=z,
            free_length=length,
            offset=offset,
            covariance=state.covariance.copy(),
        )

    def _carry(self, state: _State, theta: float, guide: float) -> None:
        config = self.config
        step = theta - state.theta
        z, length, offset = state.mean
        moved = guide - state.guide
        eye = 0.5 * (guide + state.guide) + offset
        rate = step * config.radius / length
        kept = math.exp(-rate)
        behind = z - eye
        change = np.eye(3)
        change[Z] = (kept, behind * kept * rate / length, 1.0 - kept)
        state.mean = np.array([eye + behind * kept, length, offset])
        noise = np.array([config.drift_z, config.drift_length, config.drift_offset]) ** 2 * step
        # The eye lags behind its carriage by the play once that turns back.
        if moved and moved * state.heading < 0.0:
            noise[OFFSET] += config.play**2 / 3.0
        if moved:
            state.heading = moved
        state.covariance = change @ state.covariance @ change.T + np.diag(noise)
        state.theta, state.guide = theta, guide

    def _between(self, theta: float) -> float:
        """Return the carriage's reading [m] at an angle between the last one taken and the next."""
        later, guide = self._since[0]
        seen = self._seen
        share = (theta - seen.theta) / (later - seen.theta)
        return seen.guide + share * (guide - seen.guide)

    def _bound(self, state: _State) -> None:
        """Keep the free length within what a machine can be: half to twice of what is believed."""
        believed = self.config.free_length
        state.mean[LENGTH] = min(max(state.mean[LENGTH], 0.5 * believed), 2.0 * believed)

    @staticmethod
    def _copied(state: _State) -> _State:
        return _State(
            mean=state.mean.copy(),
            covariance=state.covariance.copy(),
            theta=state.theta,
            guide=state.guide,
            heading=state.heading,
        )
