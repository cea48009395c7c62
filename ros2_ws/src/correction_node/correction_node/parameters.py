"""Parameters of the correction node."""

from __future__ import annotations

from dataclasses import dataclass

from cable_winding.condition import ConditionParameters
from cable_winding.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class CorrectionParameters(ConditionParameters):
    """What is wound, and which trained weight corrects it."""

    weights: str = parameter(
        "rod", "trained weight: the name of a shipped one, or the folder of one's own"
    )
