"""What an operator calls good, as the page says it in its diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

from winding_core.error_verdict import ErrorLimit
from winding_core.lay_tolerance import LayTolerance

COMPONENT = "limits"


@dataclass(frozen=True, kw_only=True)
class OperatorLimits(ErrorLimit, LayTolerance):
    """How far off a corrected length and a turn may be."""

    @classmethod
    def from_values(cls, values: Mapping[str, str]) -> Self | None:
        """Return the limits that diagnostics carry; None where they carry none."""
        try:
            return cls(**{item.name: float(values[item.name]) for item in fields(cls)})
        except (KeyError, ValueError):
            return None

    def values(self) -> dict[str, str]:
        """Return the limits as values of a status, to the last digit."""
        return {name: repr(value) for name, value in vars(self).items()}
