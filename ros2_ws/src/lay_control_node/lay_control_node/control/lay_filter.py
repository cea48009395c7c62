"""Where the cable lands now: a Kalman filter over the wound angle, fed by what the camera saw."""

import math
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEP = 0.01  # Steps of the wound angle between which the guide is taken as moving evenly [rad]
_LEAST_BEND = 5.0e-4  # The span's end counts as bent over this at least [m]
# Its largest share of the free length.
_MOST_BEND = 0.3
_CHANGE = 1.0e-4
_UNKNOWN = 0.03  # How far the cable may land from the guide where nothing is known [m]
# A height further off than so many deviations, and than the gate, is an outlier. Outliers that
# persist over such an angle [rad] are accepted: then the estimate is wrong, and begins anew.
_OUTLYING, _PERSISTENT = 6.0, math.pi
Z, HEADED, LENGTH, OFFSET = range(4)


@dataclass(frozen=True, kw_only=True)
class LayFilterConfig:
    """Prior of the lay before anything has landed, and how much it may drift."""

    radius: float  # Centreline radius R + r [m]
    free_length: float  # Prior of the tangent span between cylinder and guide [m]
    sigma_length: float = 0.02  # One standard deviation of that prior [m]
    # Of the place of the cable's eye against the carriage's reading [m].
    sigma_offset: float = 3.0e-4
    # Of what the law of the lag leaves out, per square root of a radian [m].
    drift_z: float = 3.0e-5
    drift_length: float = 1.0e-3  # Of the effective free length, per square root of a radian [m]
    drift_offset: float = 3.0e-5  # Of the eye's place, per square root of a radian [m]
    # Play of the eye on its carriage [m]; the eye is somewhere in it after a reversal.
    play: float = 3.0e-4
    correlated: float = 3.0e-5  # Part of a measured height that its neighbours have in common [m]
    gate: float = 4.0e-3  # How far off a height may be whatever the deviations [m]

    def __post_init__(self) -> None:
        for name in ("radius", "free_length", "sigma_length", "sigma_offset"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive, got {value} m")


@dataclass(frozen=True, kw_only=True)
class LayEstimate:
    """The lay at the contact line."""

    theta: float  # Wound angle [rad]
    z: float  # Where the cable lands [m]
    headed: float  # Where the span points to behind its bent end, z + l z' [m]
    free_length: float  # Length L of the span [m]
    bend_length: float  # Length l over which its end is bent [m]
    offset: float  # Place of the eye beside the carriage's reading [m]
    covariance: Array  # Of z, headed, free length and offset [m^2], shape (4, 4)

    @property
    def sigma_z(self) -> float:
        """One standard deviation of z [m]."""
        return math.sqrt(self.covariance[Z, Z])

    @property
    def sigma_length(self) -> float:
        """One standard deviation of the free length [m]."""
        return math.sqrt(self.covariance[LENGTH, LENGTH])


class Place(NamedTuple):
    """Where the machine stands while it lays, and how the span runs there."""

    theta: float  # Wound angle [rad]
    guide: float  # Reading of the carriage [m]
    bend: float = 0.0  # Length l over which the end of the span is bent [m]
    raised: float = 0.0  # Height of the cable above that on the bare cylinder [m]
    longer: float = 0.0  # What the guide's reported place adds to the configured free length [m]


@dataclass(kw_only=True)
class _State:
    """Mean (4,), covariance (4, 4), and the place up to which they hold.

    Of the mean the free length is that from the bare cylinder, where the guide has its configured
    distance.
    """

    mean: Array
    covariance: Array
    at: Place
    heading: float = 0.0

    def copied(self) -> Self:
        return replace(self, mean=self.mean.copy(), covariance=self.covariance.copy())


class LayFilter:
    """Estimates z at the contact line with free length and eye offset, from delayed heights.

    The span with bending stiffness obeys z + L z' + l (L - l) z'' = g + b, z' being the rise per
    way (R + r) Theta and l = sqrt(EI / T): a lag of L - l and one of l in a row, with h between
    them. The state is z, h, L and b, an extended Kalman filter in the wound angle: a standing
    cylinder lays nothing. Two states are kept. One stands where the
    last measured height is and moves on with the next; the other is that state carried on to the
    present along the guide's way since.

    On a drum the radius of each layer is that of its plan. While the guide keeps its distance from
    the axis one free length on the bare cylinder is that of every layer; what a reported distance
    adds to it is added, and the estimate is of the rest.
    """

    def __init__(self, config: LayFilterConfig) -> None:
        self.config = config
        variances = (1.0e-10, 1.0e-10, config.sigma_length**2, config.sigma_offset**2)
        self._seen = _State(
            mean=np.array([0.0, 0.0, config.free_length, 0.0]),
            covariance=np.diag(variances),
            at=Place(0.0, 0.0, _LEAST_BEND),
        )
        self._now = self._seen.copied()
        self._since: deque[Place] = deque()
        self._refused_from: float | None = None

    def join(self, place: Place, slope: float) -> None:
        """Begin in mid-run, with a cable that has followed an even guide for long.

        Where it lands is known no better than that.

        Args:
            place: Of the machine now.
            slope: dz/dtheta of the lay [m/rad].
        """
        config, raised = self.config, place.raised
        radius = config.radius + raised
        span = self._span(config.free_length + place.longer, raised)
        z = place.guide - slope * span / radius
        bend = min(max(place.bend, _LEAST_BEND), _MOST_BEND * span)
        near = slope * bend / radius
        variances = (_UNKNOWN**2, _UNKNOWN**2, config.sigma_length**2, config.sigma_offset**2)
        self._seen = _State(
            mean=np.array([z, z + near, config.free_length, 0.0]),
            covariance=np.diag(variances),
            at=place._replace(bend=bend),
        )
        self._now = self._seen.copied()
        self._since.clear()

    def advance(self, place: Place) -> None:
        """Carry the estimate on to a place of the machine.

        Angles that are not ahead are passed over: a cylinder that turns back lays nothing.
        """
        before = self._now.at
        if place.theta < before.theta + _STEP:
            if place.theta <= before.theta:
                self._now.at = before._replace(guide=place.guide)
            return
        place = place._replace(bend=max(place.bend, _LEAST_BEND))
        self._carry(self._now, place)
        self._since.append(place)

    def measure(
        self, theta: float, z: float, sigma: float, limit: float = math.inf, held: float = 0.0
    ) -> float | None:
        """Take the height z [m] of cable at a wound angle [rad] with its deviation [m].

        One that is off by more than a limit [m] is never accepted, however long that persists.
        Cable beside it may hold it off its place in the sense of z that `held` has, 1 or -1: then
        one that is off in that sense bounds the place only, and an estimate within the bound stays.

        Returns:
            Its innovation in standard deviations; None where it is not new, because cable
            further on has been measured already or this has not been laid yet, and where it is
            too far off to be true, such as that of another turn.
        """
        seen = self._seen
        if not (seen.at.theta < theta <= self._now.at.theta and math.isfinite(z) and sigma > 0.0):
            return None
        while self._since and self._since[0].theta <= theta:
            self._carry(seen, self._since.popleft())
        if self._since:
            between = self._since[0]._replace(theta=theta, guide=self._between(theta))
            self._carry(seen, between)
        innovation = z - seen.mean[Z]
        if held * innovation > 0.0:
            return None
        noise = sigma**2 + self.config.correlated**2
        if abs(innovation) > limit or self._is_outlier(
            theta, innovation, seen.covariance[Z, Z] + noise
        ):
            return None
        column = seen.covariance[:, Z]
        spread = column[Z] + noise
        score = float(innovation / math.sqrt(spread))
        gain = column / spread
        seen.mean = seen.mean + gain * innovation
        seen.covariance = seen.covariance - np.outer(gain, column)
        self._bound(seen)
        self._now = seen.copied()
        for place in self._since:
            self._carry(self._now, place)
        return score

    def _is_outlier(self, theta: float, innovation: float, spread: float) -> bool:
        """Return whether a height is refused; accept outliers that persist."""
        if abs(innovation) <= max(self.config.gate, _OUTLYING * math.sqrt(spread)):
            self._refused_from = None
            return False
        if self._refused_from is None:
            self._refused_from = theta
        if theta < self._refused_from + _PERSISTENT:
            return True
        self._refused_from = None
        for index in (Z, HEADED):
            self._seen.covariance[index, index] += _UNKNOWN**2
        # What led the estimate astray is in the free length as well, and would do so again.
        self._seen.mean[LENGTH] = self.config.free_length
        self._seen.covariance[LENGTH] = self._seen.covariance[:, LENGTH] = 0.0
        self._seen.covariance[LENGTH, LENGTH] = self.config.sigma_length**2
        return False

    @property
    def measured_to(self) -> float:
        """Wound angle up to which cable has been measured [rad]."""
        return self._seen.at.theta

    def estimate(self) -> LayEstimate:
        """Return the lay now."""
        state, at = self._now, self._now.at
        z, headed, length, offset = map(float, state.mean)
        length = self._span(length + at.longer, at.raised)
        return LayEstimate(
            theta=at.theta,
            z=z,
            headed=headed,
            free_length=length,
            bend_length=min(at.bend, _MOST_BEND * length),
            offset=offset,
            covariance=state.covariance.copy(),
        )

    def _span(self, length: float, raised: float) -> float:
        """Return the free length [m] of cable that lies higher, by that on the bare cylinder."""
        radius = self.config.radius
        return math.sqrt(max(length**2 - raised * (2.0 * radius + raised), _LEAST_BEND**2))

    def _carry(self, state: _State, place: Place) -> None:
        config, before = self.config, state.at
        theta, guide, bend, raised, longer = place
        step = theta - before.theta
        moved = guide - before.guide
        middle = 0.5 * (guide + before.guide)
        z, headed, length, offset = map(float, state.mean)
        turned = step * (config.radius + raised)
        span = self._span(length + longer, raised)
        further = self._span(length + longer + _CHANGE, raised)
        after = _landed(z, headed, span, middle + offset, turned, bend)
        varied = _landed(z, headed, further, middle + offset, turned, bend)
        slow, fast, mixed = _kept(span, turned, bend)
        change = np.eye(4)
        # What is kept of z and of h, what L changes, and the rest comes from the eye.
        change[Z] = (fast, mixed, (varied[0] - after[0]) / _CHANGE, 1.0 - fast - mixed)
        change[HEADED] = (0.0, slow, (varied[1] - after[1]) / _CHANGE, 1.0 - slow)
        state.mean = np.array([*after, length, offset])
        drifts = (config.drift_z, config.drift_z, config.drift_length, config.drift_offset)
        noise = np.array(drifts) ** 2 * step
        # The eye lags behind its carriage by the play once that turns back.
        if moved and moved * state.heading < 0.0:
            noise[OFFSET] += config.play**2 / 3.0
        if moved:
            state.heading = moved
        state.covariance = change @ state.covariance @ change.T + np.diag(noise)
        state.at = place

    def _between(self, theta: float) -> float:
        """Return the carriage's reading [m] at an angle between the last one taken and the next."""
        later, guide, *_ = self._since[0]
        seen = self._seen.at
        share = (theta - seen.theta) / (later - seen.theta)
        return seen.guide + share * (guide - seen.guide)

    def _bound(self, state: _State) -> None:
        """Keep the free length within what a machine can be: half to twice of the prior."""
        prior = self.config.free_length
        state.mean[LENGTH] = min(max(state.mean[LENGTH], 0.5 * prior), 2.0 * prior)


def _kept(length: float, turned: float, bend: float) -> tuple[float, float, float]:
    """Return what is left of h - eye and of z - eye, and what z - eye gets of h - eye.

    Args:
        length: Of the span [m].
        turned: Way of the cylinder's surface [m].
        bend: Length over which the end of the span is bent [m].
    """
    bend = min(bend, _MOST_BEND * length)
    slow, fast = math.exp(-turned / (length - bend)), math.exp(-turned / bend)
    return slow, fast, (length - bend) / (length - 2.0 * bend) * (slow - fast)


def _landed(
    z: float, headed: float, length: float, eye: float, turned: float, bend: float
) -> tuple[float, float]:
    """Return z and h [m] after a way of the surface [m] with the eye at a place [m]."""
    slow, fast, mixed = _kept(length, turned, bend)
    return eye + (z - eye) * fast + (headed - eye) * mixed, eye + (headed - eye) * slow
