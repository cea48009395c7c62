"""The result of one check."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum


class Level(StrEnum):
    """How a check ended; only FAIL keeps the graph from running as it should."""

    OK = "OK"
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One line of the doctor's table.

    Attributes:
        check: What was examined.
        level: How it is.
        found: What was found.
        advice: What to do; empty when there is nothing to do.
    """

    check: str
    level: Level
    found: str
    advice: str = ""

    def as_record(self) -> dict[str, str]:
        """Return the finding for a JSON file."""
        return asdict(self)


def ok(check: str, found: str) -> Finding:
    """Return a finding that asks for nothing."""
    return Finding(check=check, level=Level.OK, found=found)


def warn(check: str, found: str, advice: str) -> Finding:
    """Return a finding that the graph runs with, not as well as it could."""
    return Finding(check=check, level=Level.WARN, found=found, advice=advice)


def fail(check: str, found: str, advice: str) -> Finding:
    """Return a finding that the graph does not run with."""
    return Finding(check=check, level=Level.FAIL, found=found, advice=advice)
