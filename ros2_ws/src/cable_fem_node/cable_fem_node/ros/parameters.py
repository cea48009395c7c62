"""Parameters of the solver's node."""

from __future__ import annotations

from dataclasses import dataclass

from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.condition import ConditionParameters
from winding_core.material_law import LAWS
from winding_core.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class FemParameters(ConditionParameters):
    """What is wound, and how the rod model discretises it."""

    law: str = parameter("linear", "material law", choices=tuple(LAWS))
    friction: float = parameter(
        0.1, "Coulomb friction of cable on cylinder, dimensionless", low=0.0, high=2.0
    )
    segment_length: float = parameter(
        0.005, "undeformed length of a rod element [m]", low=0.0005, high=0.05
    )
    mass_scaling: float = parameter(1.0, "factor on the cable's density", low=1.0, high=1.0e4)
    rolling: bool = parameter(False, "whether the cable may roll on the cylinder")
    follow_tension: bool = parameter(
        True, "whether the span tension follows rig/tension instead of the dead weight"
    )
    update_material: bool = parameter(
        True, "whether the effective modulus is identified from tracked markers"
    )
    take_up_material: bool = parameter(
        False, "whether the model and the prediction of the run go on with the identified modulus"
    )
    replay: str = parameter(
        "", "file of a run's inputs so far, written by the orchestrator, to wind before following"
    )

    def winding_config(self) -> WindingConfig:
        """Return the model that the parameters describe.

        Raises:
            ValueError: The condition is not one, or the material cannot carry the weight.
        """
        return WindingConfig(
            case=self.condition(),
            friction=self.friction,
            law=self.law,
            segment_length=self.segment_length,
            free_length=self.free_length,
            mass_scaling=self.mass_scaling,
            rolling=self.rolling,
        )
