"""One figure of an experiment: ours, the published ones, the bar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ExternalRow:
    """One quantity of one experiment.

    Attributes:
        experiment: Its name.
        variant: Its parameters.
        quantity: As the experiment's own definition has it, SI.
        computed: With this project's rod.
        bar: What its magnitude is held against; None for what is told only.
        at_least: Whether it must reach the bar, instead of staying below it.
        published: Of others, by solver; None for what they could not tell.
    """

    experiment: str
    variant: str
    quantity: str
    computed: float
    bar: float | None
    at_least: bool
    published: Mapping[str, float | None]

    @property
    def passed(self) -> bool:
        """Whether the bar is kept; a nan never keeps one."""
        if self.bar is None:
            return True
        size = abs(self.computed)
        return size >= self.bar if self.at_least else size <= self.bar
