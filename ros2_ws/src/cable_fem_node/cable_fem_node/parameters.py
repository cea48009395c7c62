"""Parameters of the solver's node."""

from __future__ import annotations

from dataclasses import dataclass

from cable_fem_node.uniaxial import LAWS
from cable_winding.condition import ConditionParameters
from cable_winding.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class FemParameters(ConditionParameters):
    """What is wound, and how the rod model discretises it."""

    law: str = parameter("linear", "material law", choices=tuple(LAWS))
    friction: float = parameter(0.1, "Coulomb friction of cable on cylinder", low=0.0, high=2.0)
    segment_length: float = parameter(
        0.005, "undeformed length of a rod element [m]", low=0.0005, high=0.05
    )
    mass_scaling: float = parameter(1.0, "factor on the cable's density", low=1.0, high=1.0e4)
    rolling: bool = parameter(False, "whether the cable may roll on the cylinder")
    follow_tension: bool = parameter(
        True, "whether the span tension follows rig/tension instead of the dead weight"
    )
