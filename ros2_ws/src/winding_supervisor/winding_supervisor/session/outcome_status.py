"""The outcome of the run that is over, in the diagnostics for the operator's page."""

from __future__ import annotations

from winding_core.run_outcome import RunOutcome, Verdict
from winding_core.status import OUTCOME_COMPONENT, Level
from winding_ros.client.async_client import AsyncClient

_LEVELS = {Verdict.FAILED: Level.ERROR, Verdict.NOT_GOOD: Level.WARN}


def tell_outcome(client: AsyncClient, t: float, outcome: RunOutcome | None) -> None:
    """Publish an outcome; None once another run begins.

    Args:
        client: The orchestrator's node.
        t: The machine's time [s].
        outcome: Of the run that is over.
    """
    if outcome is None:
        client.tell(t, Level.OK, OUTCOME_COMPONENT, "no run is over", {})
        return
    values = {"verdict": outcome.verdict.value, "sentences": "\n".join(outcome.sentences)}
    level = _LEVELS.get(outcome.verdict, Level.OK)
    client.tell(t, level, OUTCOME_COMPONENT, outcome.headline, values)
