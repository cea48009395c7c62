"""How the rod lands a cable: what its elements and springs add to the closed form of the landing.

In the limit of short elements and a hard surface cable lies with the tension F - EI l / (2 rho^2)
and lags behind the guide by L cos(phi) / rho. The rod differs by some thousandths, as its elements
and its contact are. For one cable on one cylinder that depends on the strain of the span alone, so
short rods are wound and asked.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np

from cable_fem_node.dynamics.state import FloatArray, SolverError
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import replay
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.machine.drive import DriveProfile
from winding_core.machine.tension import DeadWeight
from winding_core.run_inputs import Inputs, planned_inputs

# Wound angle of a short rod [rad], and what of it is left out: as a share the start, until the
# bent end of the span has come to rest, and as elements what is still landing.
_WOUND, _START, _LANDING = 7.0, 0.55, 5
# Wound angle within which the guide comes to where it is ahead of the cable in the end [rad].
_AHEAD = 0.3
# Strains of the span that are asked for: so many to an octave, from a third of that of a run to
# one and a half times it.
_OCTAVE, _BELOW, _ABOVE = 2, 0.33, 1.5
# Beyond this share of the tension that bending takes the rod does not know it to a percent.
_MOST_BENT = 0.35
_HIGHEST_STRESS = 0.9  # Of the law's limit
# Waves of the span run at most so many times as fast as the line; stiff cable is made heavier.
_WAVES = 2000.0


@dataclass(frozen=True, kw_only=True)
class Landing:
    """What the rod adds at ascending strains of the span, each of shape (k,)."""

    strain: FloatArray  # Of the span
    excess: FloatArray  # Wound tension over F - EI l / (2 rho^2), less one
    lag: FloatArray  # Lag behind the guide over L cos(phi) / rho, less one
    element: FloatArray  # Length of a stretched element over the radius [rad]
    held: FloatArray  # How many elements behind the landing point friction begins to hold
    press: FloatArray  # Stiffness of a node's contact over EA / h of its element
    stick: FloatArray  # The same along the surface

    def at(self, stretch: FloatArray) -> Landing:
        """Return all at stretches of the span, even in the logarithm of the strain."""
        place = np.log(np.maximum(stretch - 1.0, 1.0e-9))
        known = np.log(self.strain)
        return Landing(
            **{item.name: np.interp(place, known, getattr(self, item.name)) for item in _FIELDS}
        )


_FIELDS = fields(Landing)
# The limit of short elements and a hard surface.
_LIMIT = ("strain", "press", "stick")
SHORT_ELEMENTS = Landing(**{item.name: np.full(1, float(item.name in _LIMIT)) for item in _FIELDS})


def landing_of(
    config: WindingConfig, drive: DriveProfile, stretch: float, *, late: bool
) -> Landing:
    """Return how the rod lands a cable.

    Args:
        config: What is wound; its tension does not matter.
        drive: How the axes move.
        stretch: About that of the span, a ratio of lengths.
        late: Whether friction holds a landing later, as the rod has it with stiff cable.
    """
    case, law = config.case, config.resolved.law
    bend = 0.5 * case.bending_stiffness / (case.material.young * case.axial_area)
    least = max(bend / (_MOST_BENT * case.centreline_radius**2), 1.0e-5)
    highest = _HIGHEST_STRESS * float(law.nominal_stress(min(law.limit()[1], 3.5)))
    most = law.stretch_at(highest) - 1.0
    strain = min(max(stretch - 1.0, least), most)
    first, last = (round(_OCTAVE * math.log2(share * strain)) for share in (_BELOW, _ABOVE))
    rungs = {min(max(2.0 ** (power / _OCTAVE), least), most) for power in range(first, last + 1)}
    plain = dataclasses.replace(config, tension_law=DeadWeight(), drum=None, rolling=False)
    found = [_asked(plain, drive, rung, late) for rung in sorted(rungs)]
    table = np.array([rung for rung in found if rung]).T
    if not table.size:
        return SHORT_ELEMENTS
    return Landing(**{item.name: row for item, row in zip(_FIELDS, table, strict=True)})


@lru_cache(maxsize=256)
def _asked(
    config: WindingConfig, drive: DriveProfile, strain: float, late: bool
) -> tuple[float, ...] | None:
    """Return a landing at one strain of the span, in the order of its fields; None without one."""
    case, law = config.case, config.resolved.law
    tension, like = _tension(config, strain), strain
    speed = drive.angular_speed * case.centreline_radius
    heavy = law.tangent(1.0) / (case.material.density * (_WAVES * speed) ** 2)
    scaling = max(config.mass_scaling, heavy)
    try:
        while True:
            own = dataclasses.replace(
                config,
                case=dataclasses.replace(case, weight=_tension(config, like)),
                mass_scaling=scaling,
            )
            # The rod decides by the stated tension; the measured one may be another.
            if bool(own.resolved.constants.late) == late:
                break
            like *= 0.95 if late else 1.05
        rod = RodWinding(own)
        cosine = own.resolved.wound_tension(tension) / tension
        lag = own.free_length * cosine / own.resolved.radius_at(1.0 + strain)
        inputs = _led_ahead(drive, lag, tension)
        replay(inputs, rod)
    except (SolverError, ValueError):
        return None
    return (strain, *_seen(rod, inputs, tension, lag))


def _tension(config: WindingConfig, strain: float) -> float:
    return config.case.axial_area * float(config.resolved.law.nominal_stress(1.0 + strain))


def _led_ahead(drive: DriveProfile, lag: float, tension: float) -> Inputs:
    """Return inputs whose guide is ahead at once by as much as in the end."""
    inputs = planned_inputs(drive, drive.time_at_angle(_WOUND), tension=tension)
    left = lag * np.exp(-inputs["cylinder_angle"] / _AHEAD)
    inputs["carriage_position"] += drive.advance_per_radian * (lag - left)
    inputs["feed_speed"] *= 1.0 + left / _AHEAD
    return inputs


def _seen(rod: RodWinding, inputs: Inputs, tension: float, lag: float) -> tuple[float, ...]:
    resolved = rod.config.resolved
    constants, case = resolved.constants, rod.config.case
    _, theta, z = rod.wound_path()
    steady = slice(min(int(_START * theta.size), theta.size - _LANDING - 2), -_LANDING)
    wound = float(rod.tension()[: theta.size - 1][steady].mean())
    theta, z = theta[steady], z[steady]
    rise = (z[-1] - z[0]) / (theta[-1] - theta[0])
    behind = np.interp(theta, inputs["cylinder_angle"], inputs["carriage_position"]) - z
    stretch = resolved.stretch_at(tension)
    spring = case.material.young * case.axial_area / resolved.segment
    return (
        wound / resolved.wound_tension(tension) - 1.0,
        float(behind.mean() / rise) / lag - 1.0 if rise else 0.0,
        resolved.segment * stretch / resolved.radius_at(stretch),
        1.0 + constants.late,
        constants.touch.normal_stiffness / spring,
        constants.touch.stick_stiffness / spring,
    )
