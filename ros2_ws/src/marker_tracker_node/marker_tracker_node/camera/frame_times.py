"""Whether the times of recorded pictures can be used, and what is to be said of them."""

from __future__ import annotations

import math

import numpy as np

from winding_core.units import MILLISECOND

# Steps that differ by less are even: containers round times to milliseconds.
EVEN_SHARE = 0.1
ROUNDING = 1.001e-3
# Rates that differ by less are the same.
SAME_RATE = 0.005
# So many equal times in succession are no times.
REPEATED = 3


class FrameTimeError(ValueError):
    """Pictures have no times that can be used."""


class FrameTimes:
    """Times of a recording's pictures, as they come."""

    def __init__(self, owner: str, *, backwards: bool = False, advice: str = "") -> None:
        """Start without a picture.

        Args:
            owner: What the times are those of, to begin a sentence with.
            backwards: Whether single pictures may be older than the one before.
            advice: What to do when there are no times; empty where nothing can be done.
        """
        self._owner = owner
        self._backwards = backwards
        self._advice = f"; {advice}" if advice else ""
        self._times: list[float] = []

    def take(self, t: float) -> float:
        """Return the time of the next picture [s].

        Raises:
            FrameTimeError: It is no number, times run backwards, or they stand still.
        """
        times, number = self._times, len(self._times) + 1
        if not math.isfinite(t):
            raise FrameTimeError(
                f"{self._owner}: picture {number} is at {t} s, which must be finite{self._advice}"
            )
        times.append(t)
        if number >= REPEATED and len(set(times)) == 1:
            raise FrameTimeError(
                f"{self._owner}: the first {number} pictures are all at {t:g} s, and times must "
                f"ascend{self._advice}"
            )
        if number > 1 and t < times[-2] and not self._backwards:
            raise FrameTimeError(
                f"{self._owner}: picture {number} is at {t:.6f} s, before the {times[-2]:.6f} s of "
                f"the one before, and times must ascend{self._advice}"
            )
        return t

    @property
    def rate(self) -> float:
        """The usual number of pictures a second [1/s]; nan before there are two."""
        steps = self._steps()
        return 1.0 / float(np.median(steps)) if steps.size else math.nan

    def unevenness(self) -> str:
        """Return how unevenly the times are spaced; empty where they are not."""
        steps = self._steps()
        if not steps.size:
            return ""
        usual, low, high = float(np.median(steps)), float(steps.min()), float(steps.max())
        if high - low <= max(EVEN_SHARE * usual, min(ROUNDING, 0.5 * usual)):
            return ""
        t = np.array(self._times)
        wrong = np.abs(t - t[0] - usual * np.arange(t.size)).max()
        return (
            f"pictures are unevenly spaced: {low / MILLISECOND:.1f} to {high / MILLISECOND:.1f} ms "
            f"apart, mostly {usual / MILLISECOND:.1f} ms; counted at that rate, a picture would be "
            f"up to {wrong / MILLISECOND:.0f} ms wrong"
        )

    def contradiction(self, fps: float) -> str:
        """Return how a rate [1/s] that was given contradicts the times; empty where it does not."""
        rate = self.rate
        if math.isnan(rate) or abs(fps / rate - 1.0) <= SAME_RATE:
            return ""
        return f"{self._owner} has {rate:g} pictures a second, {fps:g} were given"

    def _steps(self) -> np.ndarray:
        steps = np.diff(np.array(self._times))
        return np.asarray(steps[steps > 0.0])
