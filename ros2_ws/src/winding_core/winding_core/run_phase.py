"""How far a run that an operator conducts is, as the orchestrator says it."""

from __future__ import annotations

from enum import Enum

COMPONENT = "run"
STATUS = f"orchestrator: {COMPONENT}"


class RunPhase(Enum):
    """Of one run after the other; a simulated machine says all but FAILED by itself."""

    READY = "ready"
    UNDER_WAY = "under way"
    OVER = "over"
    PREPARED = "being prepared"
    FAILED = "failed"
