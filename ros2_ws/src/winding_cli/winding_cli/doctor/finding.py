"""The result of one check."""

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How a check ended; only FAIL keeps the graph from running as it should."""

    OK = "OK"
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One line of the doctor's table."""

    check: str  # What was examined
    level: Level  # How it is
    found: str  # What was found
    advice: str = ""  # What to do; empty when there is nothing to do


def ok(check: str, found: str) -> Finding:
    """Return a finding that asks for nothing."""
    return Finding(check=check, level=Level.OK, found=found)


def warn(check: str, found: str, advice: str) -> Finding:
    """Return a finding that the graph runs with, not as well as it could."""
    return Finding(check=check, level=Level.WARN, found=found, advice=advice)


def fail(check: str, found: str, advice: str) -> Finding:
    """Return a finding that the graph does not run with."""
    return Finding(check=check, level=Level.FAIL, found=found, advice=advice)


def judged(check: str, found: str, advice: str, *, fine: bool, fails: bool = False) -> Finding:
    """Return a finding that is fine, or else a failure or a warning with advice."""
    if fine:
        return ok(check, found)
    return fail(check, found, advice) if fails else warn(check, found, advice)
