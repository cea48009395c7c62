"""How the solver winds a condition: mesh, mass scaling and rolling as parameters."""

from __future__ import annotations

from dataclasses import dataclass

from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.condition import ResolvedCondition
from winding_core.parameters import parameter
from winding_core.units import LENGTH, PLAIN


@dataclass(frozen=True, kw_only=True)
class SolverParameters:
    """Discretisation of the cable; what is wound stands in `winding_core.condition`."""

    segment_length: float = parameter(
        WindingConfig.segment_length,
        "undeformed length of an element",
        LENGTH,
        0.0005,
        0.05,
        option="segment",
    )
    mass_scaling: float = parameter(
        0.0,
        "factor on the cable's density",
        PLAIN,
        1.0,
        1.0e4,
        otherwise="1 with the rod and 400 with the solid",
    )
    rolling: bool = parameter(False, "whether the rod may roll on the cylinder", unit=PLAIN)

    def config_of(self, what: ResolvedCondition, *, mass_scaling: float = 1.0) -> WindingConfig:
        """Return the model of a condition.

        Args:
            what: What is wound.
            mass_scaling: Factor on the density where the parameters leave it open.

        Raises:
            ValueError: The condition cannot be wound with this mesh, or the material cannot
                carry the weight.
        """
        return WindingConfig(
            case=what.case,
            friction=what.friction,
            law=what.law,
            mooney_ratio=what.mooney_ratio,
            tension_law=what.tension_law,
            free_length=what.free_length,
            segment_length=self.segment_length,
            mass_scaling=self.mass_scaling or mass_scaling,
            rolling=self.rolling,
        )
