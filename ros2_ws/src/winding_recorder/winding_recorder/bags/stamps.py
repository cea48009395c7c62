"""What the bag times of one topic say: order, rhythm, gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_PERIODIC_SHARE = 0.9
_TOLERANCE = 0.05
_GAP = 1.5
_FEW = 10


def stamp_findings(name: str, stamps: NDArray[np.int64], *, ordered: bool) -> list[str]:
    """Return what is wrong with a topic's bag times, in the order they were stored.

    A topic has a rhythm when nine of ten intervals are within 5 % of their median; then an
    interval of more than one and a half medians is a gap.

    Args:
        name: The topic.
        stamps: Bag times [ns], shape (n,).
        ordered: Whether times must not go back; they may where several nodes publish.
    """
    findings = []
    steps = np.diff(stamps)
    back = np.flatnonzero(steps < 0)
    if ordered and back.size:
        findings.append(
            f"{name}: time goes back {back.size} times, first after {stamps[back[0]] * 1e-9:.6f} s"
        )
    period = rhythm(stamps)
    if period is not None:
        gaps = np.flatnonzero(steps > _GAP * period)
        if gaps.size:
            missing = int(np.round(steps[gaps] / period - 1.0).sum())
            findings.append(
                f"{name}: {gaps.size} gaps, about {missing} messages of {1e9 / period:g} Hz, "
                f"first after {stamps[gaps[0]] * 1e-9:.6f} s"
            )
    return findings


def rhythm(stamps: NDArray[np.int64]) -> float | None:
    """Return the period [ns] of a topic that has one."""
    steps = np.diff(stamps)
    if steps.size < _FEW:
        return None
    period = float(np.median(steps))
    if period <= 0.0:
        return None
    regular = np.abs(steps - period) <= _TOLERANCE * period
    return period if regular.mean() >= _PERIODIC_SHARE else None
