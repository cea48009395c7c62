"""Three layers between flanges under control, on a rig whose properties the controller cannot see.

The lag law, the cable below and the errors of the tracker are the rig's; the controller is given
encoder, carriage, pull and the places that the tracker measures, those of the first layer alone
where it sees no higher.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import WantedProgram
from lay_control_node.control.layer_watch import Fault, LayerWatch
from winding_core.cable.condition import Condition
from winding_core.lay.drum_parameters import DrumParameters
from winding_rig_node.lay.lay_on import HiddenRig
from winding_verification.closed_loop.run import ClosedResult, ClosedRun, wind

TURN = 2.0 * math.pi
WHAT = Condition(case=9).resolved()
D = WHAT.case.cable_diameter
# Turns that nearly touch: 1.025 diameters.
PITCH = 4.1e-3
DRUM = DrumParameters(drum_width=26.0e-3, flange=0.02, layers=3)
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


def pushed(begin: float, off: float) -> Callable[[float], float]:
    """Return a law that moves the eye off its carriage [m] from so many turns on for one turn."""
    return lambda angle: off if begin < angle / TURN < begin + 1.0 else 0.0


@pytest.mark.parametrize("begin", [1.5, 7.5], ids=["first layer", "second layer"])
@pytest.mark.parametrize("off", [4.0 * D, -4.0 * D], ids=["to higher z", "to lower z"])
def test_what_only_the_camera_sees_is_found_within_a_turn(begin: float, off: float) -> None:
    """The eye is off its carriage: encoder and guide do not show it, the tracker does."""
    result = closed(3, True, pushed(begin, off), (begin + 4.5) / WOUND.turns)
    theta, z = result.lay.theta, result.lay.z
    onward = next(item.direction for item in WOUND.layers if begin < item.last_turn)
    after = theta > begin * TURN
    apart = onward * (z[after] - np.interp(theta[after] - TURN, theta, z))
    wrong = theta[after][np.abs(apart - PITCH) > 0.3 * D]
    found = [(fault.kind, fault.theta) for fault in result.faults]
    assert {kind for kind, _ in found} >= {Fault.GAP, Fault.CLIMB}
    assert wrong.min() < min(at for _, at in found) < wrong.min() + TURN
    first = min(result.faults, key=lambda fault: fault.theta)
    assert first.kind is (Fault.GAP if off * onward > 0.0 else Fault.CLIMB)


STEP = 0.02


def watched(
    moved: Callable[[float], float] = no_offset, *, noise: float = 0.0, measured: bool = True
) -> LayerWatch:
    """Have a watch see the program, moved by a law of the turns behind P0 [m]."""
    watch, program = LayerWatch(WOUND), WOUND.program()
    rng = np.random.default_rng(1)
    for theta in np.arange(0.0, program.end, STEP):
        z = float(program.z_at(theta)) + moved(theta / TURN) + noise * float(rng.standard_normal())
        watch.land(float(theta), z, 1e-5)
        if measured:
            watch.measure(float(theta), z, 1e-5)
    return watch


@pytest.mark.parametrize("noise", [0.0, 0.1 * D])
def test_no_fault_is_invented(noise: float) -> None:
    assert watched(noise=noise).faults == []
    # A lay that is off as a whole has no gaps.
    assert watched(lambda _: 0.2 * D, noise=noise).faults == []


@pytest.mark.parametrize("turn", [2, 6, 10])
def test_a_gap_and_a_climb_are_found_within_a_turn_in_every_layer(turn: int) -> None:
    layer = next(item for item in WOUND.layers if item.first_turn <= turn < item.last_turn)
    for kind, away in ((Fault.GAP, 1.0), (Fault.CLIMB, -1.0)):
        off = 0.6 * D * away * layer.direction
        begin = turn + 0.2
        faults = watched(lambda at: off if begin < at < turn + 1.2 else 0.0).faults  # noqa: B023
        first = min(faults, key=lambda fault: fault.theta)
        assert (first.kind, first.layer) == (kind, layer.number)
        assert begin < first.theta / TURN < begin + 1.0
        assert first.measured


def test_cable_is_held_by_a_turn_that_it_touches_only() -> None:
    watch = watched()
    first, second = WOUND.layers[:2]
    for layer, theta in ((first, 2.3 * TURN), (second, (second.first_turn + 1.5) * TURN)):
        before = float(WOUND.program().z_at(theta - TURN))
        touching, apart = (before + layer.direction * width * D for width in (1.0, 1.1))
        assert watch.held(theta, touching, 1e-5) * layer.direction > 0.0
        assert watch.held(theta, apart, 1e-5) == 0.0
        assert watch.is_turn_before(theta, before + 0.1 * D)
        assert not watch.is_turn_before(theta, touching)
    assert watch.held(0.5 * TURN, 0.0, 1e-5) == 0.0
    assert not watch.is_turn_before(0.5 * TURN, 0.0)


def test_a_missing_edge_turn_is_found_where_its_layer_ends() -> None:
    first = WOUND.layers[0]

    def one_turn_late(at: float) -> float:
        """Return the way back of a guide that turns a pitch before the flange."""
        return -PITCH if first.last_turn - 1.3 < at < first.last_turn else 0.0

    faults = watched(one_turn_late, measured=False).faults
    edge = next(fault for fault in faults if fault.kind is Fault.EDGE)
    assert (edge.layer, edge.turn) == (1, int(first.last_turn))
    assert edge.off == pytest.approx(PITCH, rel=0.05)
    assert not edge.measured
    assert "not measured" in edge.sentence
