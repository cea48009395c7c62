"""A drum as options, the program that fills it, and what comes of a plan of it layer by layer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lay_control_node.planning.lay_on import StretchedCable
from lay_control_node.planning.lay_plan import LayPlan
from lay_control_node.planning.limits import PlanLimits
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.drum_winding import DrumWinding
from winding_core.lay.layers import WINDINGS, WoundDrum
from winding_core.lay.program import LayProgram
from winding_core.machine.drum import START_SIDES, Drum, DrumError
from winding_core.parameters import ParameterError, Spelling, parameter, typed_values
from winding_core.units import LENGTH, LONG_LENGTH, PLAIN, SPEED, TURNS

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class DrumParameters:
    """Flanges and grooves of the cylinder, and how it is filled between them, as options."""

    drum_width: float = parameter(
        0.0, "width between the flanges", LENGTH, 1.0e-3, 10.0, otherwise="no drum"
    )
    flange: float = parameter(
        0.0, "height of the flanges over the cylinder", LENGTH, 1.0e-4, 5.0, otherwise="none"
    )
    groove_pitch: float = parameter(
        0.0, "pitch of the drum's grooves", LENGTH, 1.0e-4, 0.2, otherwise="a smooth drum"
    )
    start_side: str = parameter(
        "low", "flange at which P0 lies, by its z", PLAIN, choices=tuple(START_SIDES)
    )
    winding: str = parameter("orthocyclic", "how turns and layers lie", PLAIN, choices=WINDINGS)
    layers: int = parameter(0, "how many layers", PLAIN, 1, 10_000, otherwise="those of the length")
    length: float = parameter(
        0.0,
        "length of cable on the drum",
        LONG_LENGTH,
        1.0e-3,
        1.0e5,
        otherwise="that of the layers",
    )
    crossing_share: float = parameter(
        DrumWinding.crossing_share,
        "share of a turn in which an orthocyclic one crosses to its next place",
        PLAIN,
        0.01,
        0.99,
    )
    edge_dwell: float = parameter(
        DrumWinding.edge_dwell,
        "for how long a parallel or cross winding rests at a flange while it climbs",
        TURNS,
        0.0,
        2.0 * math.pi,
    )
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

    @classmethod
    def from_typed(cls, typed: Mapping[str, object], *, spelling: Spelling = str) -> Self | None:
        """Return the drum that typed options mean; None where there is none.

        Args:
            typed: By option, in the unit of its name.
            spelling: How a refusal writes an option's name.

        Raises:
            ParameterError: A value is refused, or has no meaning beside the others.
        """
        values: dict[str, Any] = typed_values(cls, typed, spelling)
        found = cls(**values)
        width, flange = spelling("drum_width_mm"), spelling("flange_mm")
        if not typed:
            return None
        for value, name in ((found.drum_width, width), (found.flange, flange)):
            if not value:
                raise ParameterError(f"a drum needs {width} and {flange}, {name} is missing")
        useless = "edge_dwell_turns" if found.winding == "orthocyclic" else "crossing_share"
        if useless in typed:
            raise ParameterError(f"{found.winding} winding has no {spelling(useless)}")
        return found

    def wind(self, what: ResolvedCondition, pitch: float | None) -> WoundDrum:
        """Return the condition's cylinder as a drum with its cable on it.

        Args:
            what: What is wound.
            pitch: Between turns [m]; None for that of the grooves, or else the cable's diameter.

        Raises:
            DrumError: The cable would leave the drum, or it is not said how much goes on it.
        """
        drum = Drum(
            radius=what.case.cylinder_radius,
            width=self.drum_width,
            flange_height=self.flange,
            groove_pitch=self.groove_pitch or None,
            start_side=self.start_side,
        )
        how = DrumWinding(
            winding=self.winding,
            pitch=pitch,
            crossing_share=self.crossing_share,
            edge_dwell=self.edge_dwell,
        )
        return how.wind(
            drum, what.case.cable_diameter, layers=self.layers or None, length=self.length or None
        )

    def program(self, wound: WoundDrum, what: ResolvedCondition, limits: PlanLimits) -> LayProgram:
        """Return the program that fills the drum, with the pull on each layer.

        Args:
            wound: The drum.
            what: What is wound.
            limits: Of the machine.

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
