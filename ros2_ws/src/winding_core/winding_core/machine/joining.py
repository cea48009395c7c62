"""Values that arrive one by one become samples of all axes.

A sample belongs to one source timestamp. Values of the same source timestamp are one
sample. An axis that has no value of that time is interpolated between its neighbours in time, once
the later one has come. When none comes within the wait, the axis stands: a server reports what
changes, so its last value still holds.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Sample:
    """All axes at one instant."""

    stamp_ns: int  # Source timestamp [ns since 1970]
    values: Mapping[str, float]  # SI value of each axis


@dataclass(kw_only=True)
class JoinCounts:
    """What became of the values."""

    joined: int = 0  # Samples whose axes all have its timestamp
    interpolated: int = 0  # Samples with an axis between two of its values
    held: int = 0  # Samples with an axis at its last value
    late: int = 0  # Values that came after a sample of a later time
    early: int = 0  # Values from before the first value of another axis


@dataclass(kw_only=True)
class _Axis:
    """Values [(ns, SI, arrival in s)] that wait, and the last (ns, SI) that did."""

    waiting: deque[tuple[int, float, float]] = field(default_factory=deque)
    last: tuple[int, float] | None = None


class Joiner:
    """Joins the values of several axes by their source timestamps.

    Args:
        axes: Names of all axes.
        wait: How long a value waits for the others [s].
    """

    def __init__(self, axes: Sequence[str], wait: float) -> None:
        self.counts = JoinCounts()
        self._axes = {name: _Axis() for name in axes}
        self._wait = wait
        self._newest_ns = -1

    def add(self, axis: str, stamp_ns: int, value: float, now: float) -> None:
        """Take a value of an axis.

        Args:
            axis: Its name; timestamps of one axis increase.
            stamp_ns: Source timestamp [ns].
            value: Unit of the axis, SI.
            now: Monotonic time of arrival [s].
        """
        if stamp_ns <= self._newest_ns:
            self.counts.late += 1
        else:
            self._axes[axis].waiting.append((stamp_ns, value, now))

    def take(self, now: float) -> list[Sample]:
        """Return the samples that are complete at a monotonic time [s], oldest first."""
        samples = []
        while waiting := [axis.waiting[0] for axis in self._axes.values() if axis.waiting]:
            stamp_ns, _, arrival = min(waiting)
            # The last value that waits is as new as or newer than any that is missing.
            missing = [
                axis
                for axis in self._axes.values()
                if not axis.waiting or axis.waiting[-1][0] < stamp_ns
            ]
            if missing and now - arrival < self._wait:
                break
            sample = self._sample(stamp_ns)
            if sample is not None:
                samples.append(sample)
        return samples

    def _sample(self, stamp_ns: int) -> Sample | None:
        """Return the sample of a time and let go what is not newer; None before every axis came."""
        held = interpolated = False
        values = {}
        for name, axis in self._axes.items():
            while axis.waiting and axis.waiting[0][0] <= stamp_ns:
                axis.last = axis.waiting.popleft()[:2]
            if axis.last is None:
                continue
            before_ns, value = axis.last
            if before_ns < stamp_ns:
                if axis.waiting:
                    after_ns, after, _ = axis.waiting[0]
                    share = (stamp_ns - before_ns) / (after_ns - before_ns)
                    value += share * (after - value)
                    interpolated = True
                else:
                    held = True
            values[name] = value
        if len(values) < len(self._axes):
            self.counts.early += 1
            return None
        self._newest_ns = stamp_ns
        if held:
            self.counts.held += 1
        elif interpolated:
            self.counts.interpolated += 1
        else:
            self.counts.joined += 1
        return Sample(stamp_ns=stamp_ns, values=values)
