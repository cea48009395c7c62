"""A drum's plan: the program that fills it, and what comes of a plan of it layer by layer."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.lay_on import StretchedCable
from lay_control_node.planning.lay_plan import LayPlan
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.drum_parameters import DrumParameters
from winding_core.lay.layers import WoundDrum
from winding_core.lay.limits import PlanLimits
from winding_core.lay.program import LayProgram
from winding_core.machine.drum import DrumError
from winding_core.parameters import parameter
from winding_core.units import PLAIN, SPEED

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class DrumPlanParameters(DrumParameters):
    """A drum with what only a plan varies from layer to layer."""

    layer_pull_share: float = parameter(
        1.0, "pull on a layer as a share of that on the layer below", PLAIN, 0.1, 2.0
    )
    cable_speed: float = parameter(
        0.0,
        "speed of the cable, the same on every layer",
        SPEED,
        1.0e-4,
        10.0,
        otherwise="that of the cylinder speed on the first layer",
    )

    def program(self, wound: WoundDrum, what: ResolvedCondition, limits: PlanLimits) -> LayProgram:
        """Return the program that fills the drum, with the pull on each layer.

        Raises:
            DrumError: A pull is none of the brake's, or more than the cable carries.
        """
        name = f"{len(wound.layers)} {self.winding} layers"
        if self.layer_pull_share == 1.0:
            return wound.program(name=name)
        layers = np.arange(len(wound.layers))
        pulls: Array = np.asarray(what.case.weight * self.layer_pull_share**layers)
        low, high = limits.brake or (what.case.weight, what.case.weight)
        high = StretchedCable(what=what).highest_pull(high)
        beyond = np.flatnonzero((pulls < low) | (pulls > high))
        if beyond.size:
            raise DrumError(
                f"layer {beyond[0] + 1} would be pulled with {pulls[beyond[0]]:.4g} N, machine and "
                f"cable allow {low:.4g} to {high:.4g} N"
            )
        return wound.program(pulls, name=name)

    def paced(self, what: ResolvedCondition) -> ResolvedCondition:
        """Return the condition with the cylinder speed of the wanted cable's on the first layer."""
        if not self.cable_speed:
            return what
        speed = self.cable_speed / StretchedCable(what=what).wound_radius
        return replace(what, drive=replace(what.drive, angular_speed=speed))


def drum_record(plan: LayPlan, wound: WoundDrum) -> dict[str, Any]:
    """Return what goes on the drum, and how each layer is wound, as plain values.

    Args:
        plan: Of the drum's program, with an even speed of the cable.
        wound: The drum.
    """
    what, drum = plan.what, wound.drum
    begin = 2.0 * math.pi * np.array([layer.first_turn for layer in wound.layers])
    pull = plan.program.tension_at(begin)
    pull = np.where(np.isnan(pull), what.case.weight, pull)
    undeformed = wound.lengths / StretchedCable(what=what).stretch(pull)
    speed = plan.speed * plan.radius / (plan.radius + wound.radii - wound.radii[0])
    per_length = what.case.material.density * what.case.section_area * undeformed / wound.lengths
    return {
        "width_m": drum.width,
        "flange_diameter_m": 2.0 * drum.flange_radius,
        "groove_pitch_m": drum.groove_pitch,
        "start_side": drum.start_side,
        "winding": wound.winding,
        "pitch_m": wound.pitch,
        "turns": wound.turns,
        "length_m": wound.length,
        "undeformed_length_m": float(undeformed.sum()),
        "filled_diameter_m": wound.filled_diameter,
        "mass_kg": wound.mass(per_length),
        "inertia_kg_m2": wound.inertia(per_length),
        "cable_speed_m_s": plan.speed * plan.radius,
        "layers": [
            {
                "number": layer.number,
                "direction": layer.direction,
                "first_turn": layer.first_turn,
                "last_turn": layer.last_turn,
                "radius_m": layer.radius,
                "z_m": layer.z.tolist(),
                "last_z_m": layer.last_z,
                "length_m": layer.length,
                "undeformed_length_m": float(undeformed[k]),
                "pull_n": float(pull[k]),
                "cylinder_speed_rad_s": float(speed[k]),
            }
            for k, layer in enumerate(wound.layers)
        ],
    }
