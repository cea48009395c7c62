"""Which learned factor a run was corrected with, and what it would be without the run's case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from correction_node.models.weights import load_factor, weights_directory
from winding_core.cable.cases import published_markers
from winding_core.cable.condition import ResolvedCondition


@dataclass(frozen=True, kw_only=True)
class UsedFactor:
    """The learned factor of a run.

    Attributes:
        weights: Shipped name or folder; empty for a run without a correction.
        sha256: Of its numbers; empty where the run did not say it.
        held_out: h by marker of the training that never saw the run's case; empty where there is
            none.
    """

    weights: str = ""
    sha256: str = ""
    held_out: Mapping[int, float]


def used_factor(said: Mapping[str, str], what: ResolvedCondition) -> UsedFactor:
    """Return the factor that the correction's diagnostics name.

    Args:
        said: Values of the last diagnostics of the correction.
        what: What was wound.
    """
    weights, digest = said.get("weights", ""), said.get("weights_sha256", "")
    return UsedFactor(weights=weights, sha256=digest, held_out=_held_out(weights, digest, what))


def _held_out(weights: str, digest: str, what: ResolvedCondition) -> dict[int, float]:
    number = what.case.number
    if not (digest and number):
        return {}
    try:
        trained = load_factor(weights_directory(weights))
    except (OSError, ValueError):
        # A recording may outlive the folder of its weights.
        return {}
    if trained.card["weights_sha256"] != digest or trained.factor(what.case, what.law).outside:
        return {}
    found: Any = trained.card.get("h_left_out", {}).get(str(number), [])
    measured = [row.marker for row in published_markers(number) if row.experiment]
    if len(found) != len(measured):
        return {}
    return dict(zip(measured, map(float, found), strict=True))
