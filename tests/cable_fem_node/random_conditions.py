"""Random windings: any cable on any cylinder, as a user would wind it."""

import dataclasses
import itertools
import math

import numpy as np
from rods import cable_on

from cable_fem_node.winding.expected_cost import expected_cost
from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.machine.drive import DriveProfile

# Element-steps from which a user would take the mass scaling that is proposed, and from which a
# condition takes minutes even so and is left to `winding predict`: 20 and 400 million take about
# half a second and ten seconds.
SCALED_FROM, TOO_LONG = 2.0e7, 4.0e8


def condition(seed: int) -> tuple[WindingConfig, DriveProfile]:
    """Return a random winding.

    Raises:
        ValueError: It is refused.
    """
    rng = np.random.default_rng([16, seed])

    def spread(low: float, high: float) -> float:
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    cylinder, diameter = spread(8.0e-3, 0.3), spread(0.5e-3, 12.0e-3)
    young, tension = spread(0.5e6, 200.0e9), spread(1.0e-2, 1.0e2)
    law = str(rng.choice(["linear", "neo_hookean", "hencky"]))
    drive = DriveProfile(feed_speed=1.2 * diameter * 1.74 / math.tau)
    case = cable_on(cylinder, diameter, tension, young, marker_spacing=0.3)
    return WindingConfig(case=case, law=law), drive


def effort(run: PlannedRun) -> tuple[float, float]:
    """Return element-steps of a run and the mass scaling that is proposed for it."""
    # A clock that has always gone on by a second: one trial, whatever the computer.
    cost = expected_cost(run, map(float, itertools.count()).__next__)
    return cost.steps * cost.elements, cost.mass_scaling


def planned(seed: int) -> PlannedRun:
    """Return a condition's run as a user would wind it.

    Raises:
        SolverError, ValueError: It is refused.
    """
    config, drive = condition(seed)
    run = PlannedRun(config=config, drive=drive, duration=6.0)
    steps, scaling = effort(run)
    if steps > SCALED_FROM:
        config = dataclasses.replace(config, mass_scaling=scaling)
        run = dataclasses.replace(run, config=config)
    return run
