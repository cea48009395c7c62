"""One figure of an experiment: ours, the published ones, the bar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class ExternalRow:
    """One quantity of one experiment.

    Attributes:
        published: Of others, by solver; None for what they could not compute.
    """

    experiment: str  # Its name
    variant: str  # Its parameters
    quantity: str  # As the experiment's own definition has it, SI
    computed: float  # With this project's rod
    bar: float | None = None  # What its magnitude is held against; None for what is only reported
    at_least: bool = False  # Whether it must reach the bar, instead of staying below it
    published: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Whether the bar is kept; a nan never keeps one."""
        if self.bar is None:
            return True
        size = abs(self.computed)
        return size >= self.bar if self.at_least else size <= self.bar

    def record(self) -> dict[str, Any]:
        """Return the row for JSON."""
        record = asdict(self)
        kind = "least" if record.pop("at_least") else "most"
        return record | {"bar_is": kind, "pass": self.passed}
