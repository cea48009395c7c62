"""How far a run of a machine with a driver of its own is, as the orchestrator says it."""

from __future__ import annotations

from enum import Enum

COMPONENT = "run"
STATUS = f"orchestrator: {COMPONENT}"


class RunPhase(Enum):
    """Of one run after the other, conducted by an operator."""

    READY = "ready"
    UNDER_WAY = "under way"
    OVER = "over"
    PREPARED = "being prepared"
