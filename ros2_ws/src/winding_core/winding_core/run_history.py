"""The inputs of a run so far, thinned and bounded: enough to wind the same run again."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from winding_core.machine.readings import AxisReading
from winding_core.run_inputs import INPUT_DTYPE

# Shape (n,) of INPUT_DTYPE; t since the start of the run, a tension of nan is the model's own.
Inputs = NDArray[np.void]


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

    def _thin(self) -> None:
        kept = self._rows[: self._count : 2].copy()
        dropped = self._rows["tension"][1 : self._count : 2]
        # A mean over the longer period: of the kept sample and the dropped one before it.
        kept["tension"][1:] = 0.5 * (kept["tension"][1:] + dropped[: len(kept) - 1])
        self._count = len(kept)
        self._rows[: self._count] = kept
        self.period *= 2.0
