"""Flow control of simulated time: the rig never runs far ahead of who reads its data."""

import math
from collections.abc import Iterable


class Pace:
    """How far simulated time may go, given what the consumers have answered.

    Every consumer publishes the stamp of what it has dealt with; simulated time may lead the
    slowest by `max_lead` and no more, so that no queue between them can overflow.
    """

    def __init__(self, consumers: Iterable[str], max_lead: float) -> None:
        if not (math.isfinite(max_lead) and max_lead > 0.0):
            raise ValueError(f"max_lead must be positive, got {max_lead} s")
        self.max_lead = max_lead
        self.answered: dict[str, float] = dict.fromkeys(consumers, 0.0)

    def begin(self, t: float) -> None:
        """Take it that everybody is up to date at time t [s]."""
        for name in self.answered:
            self.answered[name] = t

    def answer(self, consumer: str, t: float) -> None:
        """Note that a consumer has dealt with everything up to t [s]; stamps never go back."""
        self.answered[consumer] = max(self.answered[consumer], t)

    @property
    def limit(self) -> float:
        """Latest allowed simulated time [s]."""
        return min(self.answered.values(), default=math.inf) + self.max_lead

    @property
    def slowest(self) -> str:
        """Consumer that holds the others up."""
        return min(self.answered, key=lambda name: self.answered[name])
