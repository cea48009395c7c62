"""The inputs of a run so far, thinned and bounded: enough to wind the same run again."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from winding_core.drive import DriveProfile
from winding_core.readings import AxisReading
from winding_core.run_inputs import INPUT_DTYPE, RunInputs

# Shape (n,) of INPUT_DTYPE; t since the start of the run, a tension of nan is the model's own.
Inputs = NDArray[np.void]


class Follower(Protocol):
    """A model that is advanced along the machine's motion."""

    time: float

    def advance_to(self, t: float, reading: AxisReading, tension: float | None = None) -> None:
        """Advance to a time [s] at which the machine stands and moves as read."""


class AbandonedError(RuntimeError):
    """A replay was no longer wanted."""


class RunHistory:
    """Keeps one sample of a run's inputs per period, and never more than a number of them.

    A full history drops every second sample and doubles its period, so a run of any length is
    covered from its start. Between samples a model follows a cubic through positions and speeds,
    which a winding machine leaves by less than its encoder's step. A kept tension is the mean of
    what was read since the sample before.

    Args:
        period: Time between kept samples [s].
        capacity: Most samples.
    """

    def __init__(self, *, period: float = 0.02, capacity: int = 4096) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise ValueError(f"period must be positive and finite, got {period} s")
        if capacity < 4:
            raise ValueError(f"capacity must be at least 4 samples, got {capacity}")
        self.period = period
        self._capacity = capacity
        self._rows = np.zeros(capacity, dtype=INPUT_DTYPE)
        self._count = 0
        self._last = -math.inf
        self._pulls = 0.0
        self._pull_count = 0

    @classmethod
    def of(cls, inputs: Inputs, *, period: float = 0.02, capacity: int = 4096) -> RunHistory:
        """Return a history of stored inputs, shape (n,) of INPUT_DTYPE, ascending in time."""
        history = cls(period=period, capacity=capacity)
        for t, reading, tension in RunInputs(samples=inputs):
            history.record(t, reading, tension)
        return history

    @property
    def inputs(self) -> Inputs:
        """The kept samples, shape (n,), a copy."""
        return self._rows[: self._count].copy()

    @property
    def duration(self) -> float:
        """Time of the last kept sample [s]; zero before the first."""
        return float(self._rows["t"][self._count - 1]) if self._count else 0.0

    @property
    def latest(self) -> float:
        """Time of the newest sample, kept or not [s]; minus infinity before the first."""
        return self._last

    def __len__(self) -> int:
        return self._count

    def record(self, t: float, reading: AxisReading, tension: float | None) -> None:
        """Take a sample of the machine at a time since the start of the run [s].

        Args:
            t: [s], later than every time before.
            reading: Both axes.
            tension: Measured span tension [N]; None where the model's own law holds.

        Raises:
            ValueError: Time does not ascend or is not finite.
        """
        if not (math.isfinite(t) and t > self._last):
            raise ValueError(f"times of a run must ascend: after {self._last} s came {t} s")
        self._last = t
        if tension is not None:
            self._pulls += tension
            self._pull_count += 1
        # Half a millisecond early, so that rounding never makes a sample late.
        if self._count and t - self.duration < self.period - 5.0e-4:
            return
        if self._count == self._capacity:
            self._thin()
            if t - self.duration < self.period - 5.0e-4:
                return
        self._rows[self._count] = (
            t,
            reading.cylinder_angle,
            reading.angular_speed,
            reading.carriage_position,
            reading.feed_speed,
            self._pulls / self._pull_count if self._pull_count else math.nan,
        )
        self._count += 1
        self._pulls, self._pull_count = 0.0, 0

    def replay(self, model: Follower, going: Callable[[], bool] = lambda: True) -> None:
        """Advance a model from its own time to the last kept sample.

        Raises:
            AbandonedError: `going` said no.
        """
        replay(self.inputs, model, going)

    def _thin(self) -> None:
        kept = self._rows[: self._count : 2].copy()
        dropped = self._rows["tension"][1 : self._count : 2]
        # A mean over the longer period: of the kept sample and the dropped one before it.
        kept["tension"][1:] = 0.5 * (kept["tension"][1:] + dropped[: len(kept) - 1])
        self._count = len(kept)
        self._rows[: self._count] = kept
        self.period *= 2.0


def replay(inputs: Inputs, model: Follower, going: Callable[[], bool] = lambda: True) -> None:
    """Advance a model from its own time along inputs, shape (n,) of INPUT_DTYPE.

    Args:
        inputs: Ascending in time.
        model: What is advanced.
        going: Asked before every step whether the result is still wanted.

    Raises:
        AbandonedError: `going` said no.
    """
    for t, reading, tension in RunInputs(samples=inputs[inputs["t"] > model.time]):
        if not going():
            raise AbandonedError(f"the replay was abandoned at t = {model.time:.6g} s")
        model.advance_to(t, reading, tension)


def planned_inputs(
    drive: DriveProfile, duration: float, *, tension: float | None = None, period: float = 0.02
) -> Inputs:
    """Return the inputs of a run that goes as planned, shape (n,), t = 0 included.

    Raises:
        ValueError: The duration [s] is not positive and finite.
    """
    if not (math.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration must be positive and finite, got {duration}")
    times = np.linspace(0.0, duration, max(1, math.ceil(duration / period - 1.0e-9)) + 1)
    inputs = np.zeros(times.size, dtype=INPUT_DTYPE)
    inputs["t"] = times
    inputs["cylinder_angle"], inputs["carriage_position"] = drive.positions(times)
    inputs["angular_speed"], inputs["feed_speed"] = drive.speeds(times)
    inputs["tension"] = math.nan if tension is None else tension
    return inputs


def continued_inputs(inputs: Inputs, angle: float, *, period: float = 0.02) -> Inputs:
    """Return inputs that go on at the run's top speeds until the cylinder has reached an angle.

    The tension stays the mean of the last second.

    Args:
        inputs: Of the run so far, shape (n,), n >= 1.
        angle: Cylinder angle to reach [rad].
        period: Time between the added samples [s].
    """
    last = inputs[-1]
    left = angle - float(last["cylinder_angle"])
    speed = float(inputs["angular_speed"].max())
    if left <= 0.0 or speed <= 0.0:
        return inputs
    feed = float(inputs["feed_speed"].max())
    count = math.ceil(left / (speed * period))
    after = period * np.arange(1, count + 1)
    more = np.zeros(count, dtype=INPUT_DTYPE)
    more["t"] = last["t"] + after
    more["cylinder_angle"] = last["cylinder_angle"] + speed * after
    more["carriage_position"] = last["carriage_position"] + feed * after
    more["angular_speed"], more["feed_speed"] = speed, feed
    more["tension"] = inputs["tension"][inputs["t"] >= last["t"] - 1.0].mean()
    return np.concatenate([inputs, more])
