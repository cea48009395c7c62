"""A plan's options: limits of the machine, and a drum with the program that fills it."""

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
from winding_core.units import (
    ACCELERATION,
    ANGULAR_ACCELERATION,
    ANGULAR_SPEED,
    FORCE,
    JERK,
    LENGTH,
    PLAIN,
    SPEED,
    TIME,
    json_values,
)
from winding_rig_node.machine.commander import CARRIAGE_LIMITS, CYLINDER_LIMITS, CommandLimits

# The simulated carriage has no limit of its own: its acceleration builds up in 50 ms [m/s^3].
CARRIAGE_JERK = CARRIAGE_LIMITS.acceleration / 0.05


@dataclass(frozen=True, kw_only=True)
class PlanParameters:
    """Limits of axes and brake as options."""

    cylinder_speed_limit: float = parameter(
        CYLINDER_LIMITS.speed, "largest cylinder speed", ANGULAR_SPEED, 0.01, 200.0
    )
    cylinder_acceleration_limit: float = parameter(
        CYLINDER_LIMITS.acceleration,
        "largest cylinder acceleration",
        ANGULAR_ACCELERATION,
        0.1,
        2000.0,
    )
    carriage_speed_limit: float = parameter(
        CARRIAGE_LIMITS.speed, "largest carriage speed", SPEED, 1.0e-4, 2.0
    )
    carriage_acceleration_limit: float = parameter(
        CARRIAGE_LIMITS.acceleration, "largest carriage acceleration", ACCELERATION, 0.01, 20.0
    )
    carriage_jerk_limit: float = parameter(
        CARRIAGE_JERK, "largest carriage jerk", JERK, 0.01, 1.0e4
    )
    carriage_travel: list[float] = parameter(
        [CARRIAGE_LIMITS.low, CARRIAGE_LIMITS.high],
        "start and end of the carriage's travel",
        LENGTH,
        -10.0,
        10.0,
    )
    brake: bool = parameter(True, "whether a brake pulls, or the dead weight alone", PLAIN)
    brake_limits: list[float] = parameter(
        [CommandLimits.low_tension, CommandLimits.high_tension],
        "smallest and largest pull of the brake",
        FORCE,
        0.0,
        1000.0,
    )
    brake_time: float = parameter(
        CommandLimits.brake_time, "time constant of the brake", TIME, 0.001, 10.0
    )
    pull_share: list[float] = parameter(
        list(PlanLimits.pull_share),
        "smallest and largest pull that steers markers, as shares of the weight",
        PLAIN,
        0.01,
        10.0,
    )

    def limits(self) -> PlanLimits:
        """Return the limits of a plan.

        Raises:
            ValueError: A range ends before it begins, or the travel does not hold 0.
        """
        return PlanLimits(
            cylinder_speed=self.cylinder_speed_limit,
            cylinder_acceleration=self.cylinder_acceleration_limit,
            carriage_speed=self.carriage_speed_limit,
            carriage_acceleration=self.carriage_acceleration_limit,
            carriage_jerk=self.carriage_jerk_limit,
            travel=(self.carriage_travel[0], self.carriage_travel[1]),
            brake=(self.brake_limits[0], self.brake_limits[1]) if self.brake else None,
            brake_time=self.brake_time,
            pull_share=(self.pull_share[0], self.pull_share[1]),
        )


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
        **json_values(wound, "winding", "pitch_m", "turns", "length_m", "filled_diameter_m"),
        "undeformed_length_m": float(undeformed.sum()),
        "mass_kg": wound.mass(per_length),
        "inertia_kg_m2": wound.inertia(per_length),
        "cable_speed_m_s": plan.speed * plan.radius,
        "layers": [
            {
                **json_values(layer, "number", "direction", "first_turn", "last_turn"),
                **json_values(layer, "radius_m", "last_z_m", "length_m"),
                "z_m": layer.z.tolist(),
                "undeformed_length_m": float(undeformed[k]),
                "pull_n": float(pull[k]),
                "cylinder_speed_rad_s": float(speed[k]),
            }
            for k, layer in enumerate(wound.layers)
        ],
    }
