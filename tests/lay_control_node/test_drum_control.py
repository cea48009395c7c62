"""Three layers between flanges under control, on a rig whose properties the controller cannot see.

The lag law, the cable below and the errors of the tracker are the rig's; the controller is given
encoder, carriage, pull and the places that the tracker measures, those of the first layer alone
where it sees no higher.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import WantedProgram
from winding_core.cable.condition import Condition
from winding_core.lay.drum_parameters import DrumParameters
from winding_rig_node.lay.lay_on import HiddenRig
from winding_verification.closed_loop.run import ClosedResult, ClosedRun, wind

TURN = 2.0 * math.pi
WHAT = Condition(case=9, angular_speed=3.5).resolved()
D = WHAT.case.cable_diameter
PITCH = 1.03 * D
DRUM = DrumParameters(drum_width=3.6 * PITCH + D, flange=0.02, layers=3)
WOUND = DRUM.wind(WHAT.case, PITCH)


def no_offset(_angle: float) -> float:
    return 0.0


def closed(
    seed: int, seen: bool, displaced: Callable[[float], float] = no_offset, end: float = 1.0
) -> ClosedResult:
    """Wind the drum, or a share of it, with the eye off its carriage by a law of the angle."""
    control = ControlParameters()
    return wind(
        ClosedRun(
            what=WHAT,
            wanted=WantedProgram.of(WOUND.program(), WHAT, control.limits(WHAT)),
            end=end * float(WOUND.theta[-1]),
            truth="driven",
            hidden=HiddenRig.drawn(np.random.default_rng(seed)),
            control=control,
            seed=seed,
            drum=WOUND,
            highest_seen=math.inf if seen else 0.25 * D,
            displaced=displaced,
        )
    )


@pytest.mark.parametrize(("seed", "seen"), [(1, True), (2, False)])
def test_three_layers_lie_within_a_tenth_of_a_diameter(seed: int, seen: bool) -> None:
    result = closed(seed, seen)
    assert result.lay is not None
    theta, layer = result.lay.theta, result.lay.layer
    turn = (theta / TURN).astype(int)
    off = result.lay.z - WOUND.program().z_at(theta)
    means = np.array([off[turn == n].mean() for n in range(int(WOUND.turns))])
    within = np.abs(means) < 0.1 * D
    assert within.mean() >= 0.95, np.round(means / D, 3)
    wanted = WOUND.layer[np.searchsorted(WOUND.theta, theta, side="right") - 1] + 1
    # The changes between layers take a part of a turn each.
    assert np.mean(layer == wanted) > 0.95
    assert result.faults == ()
