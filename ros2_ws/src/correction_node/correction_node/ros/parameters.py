"""Parameters of the correction node."""

from dataclasses import dataclass

from winding_core.cable.condition import Condition
from winding_core.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class CorrectionParameters(Condition):
    """What is wound, and which trained weight corrects it."""

    weights: str = parameter(
        "rod", "trained weight: the name of a shipped one, or a folder of trained weights"
    )
