"""Cable on cable: turns side by side, layers between flanges, the end of the cable."""

import math
from dataclasses import replace

import numpy as np
import pytest
from axis_readings import axis_reading
from dense_contact import dense_lay
from random_conditions import planned

from cable_fem_node.dynamics.state import ImpossibleResultError
from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.wound_surface import TURN, WoundSurface
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile
from winding_core.machine.drum import Drum

CASE = replace(paper_case(4), marker_count=1)
RADIUS, DIAMETER = CASE.cylinder_radius, CASE.cable_diameter
RHO = RADIUS + 0.5 * DIAMETER
SPEED, RAMP, PERIOD = 3.0, 0.3, 0.005


def drum(turns):
    return Drum(radius=RADIUS, width=turns * DIAMETER, flange_height=10.0 * DIAMETER)


def follow(model, turns, guide):
    """Wind so many turns behind a guide: its place [m] and how that goes with the angle [m/rad]."""
    t = model.time
    while model.cylinder_angle < turns * TURN:
        t += PERIOD
        up = min(t, RAMP)
        angle, speed = SPEED * (t - up + 0.5 * up * up / RAMP), SPEED * up / RAMP
        place, slope = guide(angle)
        reading = axis_reading(angle, place, speed=speed, feed=slope * speed)
        model.advance_to(t, reading)
    return model


def helical(pitch, between=None):
    """A guide that moves by a pitch [m] a turn, and back where a drum ends."""
    width = math.inf if between is None else between.width - DIAMETER

    def guide(angle):
        way = pitch * angle / TURN
        back, rest = divmod(way, width) if math.isfinite(width) else (0.0, way)
        odd = back % 2 == 1
        return (width - rest if odd else rest), (-1.0 if odd else 1.0) * pitch / TURN

    return guide


def wound(turns, pitch, between=None, **options):
    """A rod behind a helical guide."""
    config = WindingConfig(case=CASE, free_length=0.03, drum=between, **options)
    return follow(RodWinding(config), turns, helical(pitch, between))


def parallel(places, crossing):
    """A guide ahead by the lag of `wound`: turns at places [m], crossing in a share of each."""
    lag = 0.03 / RHO

    def lay(angle):
        turn, begun = divmod(angle / TURN, 1.0)
        last = len(places) - 1
        here, there = (places[min(int(turn) + i, last)] for i in (0, 1))
        u = max(begun - 1.0 + crossing, 0.0) / crossing
        step = there - here
        slope = 30.0 * u * u * (1.0 - u) ** 2 * step / crossing / TURN
        return here + u**3 * (10.0 - 15.0 * u + 6.0 * u * u) * step, slope

    def guide(angle, step=1.0e-4):
        (z, slope), (_, before), (_, after) = (lay(angle + i * step) for i in (0, -1, 1))
        return z + lag * slope, slope + lag * (after - before) / (2.0 * step)

    return guide


def laid(model):
    """Wound angles, places and heights above the first layer of the laid nodes, in diameters."""
    _, theta, z = model.wound_path()
    cable = model.cable()[: theta.size]
    height = np.hypot(cable["x"], cable["y"]) - model.config.resolved.constants.start_radius
    return theta, z / DIAMETER, height / DIAMETER


@pytest.fixture(scope="module")
def layers():
    return wound(16.5, DIAMETER, drum(6.5))


def test_turns_that_the_lag_would_lay_on_each_other_lie_side_by_side():
    theta, z, height = laid(wound(3, DIAMETER, drum(20)))
    later = np.interp(theta + TURN, theta, z, right=np.nan) - z
    # The lag law lays the second turn 0.92 diameters beside the first. The springs give way by
    # half a per cent.
    assert np.nanmin(later[theta > 0.2]) > 0.99
    assert np.abs(height[1:-2]).max() < 0.01


@pytest.mark.parametrize("seed", [2, 33, 84, 120, 154])
def test_cable_that_falls_off_cable_leaves_the_ledger_closed(seed):
    # Thin stretched cable on a pile of its own turns, thick cable on a thin cylinder: looked up a
    # quarter of a diameter deep they were thrown off, and the ledger was open by up to 145 %.
    run = planned(seed)
    assert run.checks()[-1].warned
    # The specification's bar.
    assert abs(run.wind(whole=False).energy.balance_pct) < 0.1


def test_a_turn_wound_on_the_turn_before_lies_on_it():
    config = WindingConfig(case=CASE, free_length=0.03)
    drive = DriveProfile(feed_speed=0.0)
    run = PlannedRun(config=config, drive=drive, duration=8.0).wind(whole=False)
    assert run.lies_per_turn()[1] == "on cable"


def test_less_than_a_turn_has_no_turn_that_lies_somehow():
    assert PlannedRun(config=WindingConfig(case=CASE), duration=1.0).wind().lies_per_turn() == ()


@pytest.mark.parametrize(("pitch", "lies"), [(1.0, "touching"), (1.4, "apart")])
def test_turns_touch_or_lie_apart_as_the_guide_leads_them(pitch, lies):
    config = WindingConfig(case=CASE, free_length=0.01)
    drive = DriveProfile(feed_speed=pitch * DIAMETER * 1.74 / TURN)
    run = PlannedRun(config=config, drive=drive, duration=12.0).wind(whole=False)
    assert run.lies_per_turn()[1:] == (lies,) * (run.turns - 1)


def test_cable_that_lies_apart_knows_of_no_cable_below():
    assert wound(3, 1.5 * DIAMETER)._nodes.below.shape[0] == 0


@pytest.mark.slow
def test_layers_lie_in_the_valleys_of_those_below(layers):
    theta, _, height = laid(layers)
    # A layer is 5.5 turns; in mid layer the cable lies in a valley or crosses to the next.
    for layer in (1, 2):
        inside = (theta > (5.5 * layer + 1.5) * TURN) & (theta < (5.5 * layer + 4.5) * TURN)
        lowest = np.quantile(height[inside], 0.05)
        # One per cent of the diameter for each layer.
        assert lowest == pytest.approx(layer * math.sqrt(0.75), abs=0.01 * layer)
        assert height[inside].max() < layer * 1.01


def inner(layer, turns):
    """Wound angles of a layer of so many turns, without what lies next to its flanges."""
    return np.linspace(turns * layer + 1.2, turns * (layer + 1) - 1.2, 2000) * TURN


@pytest.mark.campaign
@pytest.mark.parametrize("pitch", [1.0, 1.1, 1.3])
def test_layers_that_cross_rise_by_the_mean_of_their_crossings(pitch):
    # Flanks of valleys are as steep as p/2 over their height, 0.86 at most: friction holds the
    # cable where it lands.
    turns, aside = 5.5, np.linspace(0.0, 0.5 * pitch, 1001)
    model = wound(4 * turns, pitch * DIAMETER, drum(turns * pitch + 1.0), friction=1.0)
    theta, _, height = laid(model)
    rise = np.sqrt(1.0 - aside**2).mean()
    for layer in range(1, 4):
        mean = np.interp(inner(layer, turns), theta, height).mean()
        # The specification's bar.
        assert mean == pytest.approx(layer * rise, abs=0.01)
    assert abs(model.energy.balance_pct) < 0.1


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_ten_layers_are_as_long_as_their_closed_form_and_cost_as_much_as_the_first():
    # Friction of 1 holds cable where it lands; the guide stands beyond the tenth layer's 51 mm.
    turns, layers, between = 20, 10, drum(21)
    config = WindingConfig(case=CASE, free_length=0.06, drum=between, friction=1.0)
    model, steps = RodWinding(config), [0]
    for layer in range(1, layers + 1):
        steps.append(follow(model, layer * turns, helical(DIAMETER, between)).element_steps)
    # The specification's bars, element-steps for the processor time.
    assert np.diff(steps).max() < 2.0 * steps[1]
    assert abs(model.energy.balance_pct) < 0.1
    theta, _, _ = laid(model)
    nodes = model.cable()[: theta.size]
    way = np.sqrt(sum(np.diff(nodes[name]) ** 2 for name in "xyz")).cumsum()
    rise = DIAMETER * np.sqrt(1.0 - np.linspace(0.0, 0.5, 1001) ** 2).mean()
    closed = sum(turns * math.hypot(TURN * (RHO + n * rise), DIAMETER) for n in range(layers))
    assert np.interp(layers * turns * TURN, theta[1:], way) == pytest.approx(closed, rel=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("pitch", [1.5, 1.7])
def test_parallel_turns_lie_in_valleys_as_wide_as_their_pitch(pitch):
    # Two turns of the second layer in the valleys of four; friction holds those where they lie.
    places = [DIAMETER * pitch * at for at in (0.0, 1.0, 2.0, 3.0, 2.5, 1.5)]
    between = drum(5.0 * pitch + 1.0)
    config = WindingConfig(case=CASE, free_length=0.03, drum=between, friction=1.0)
    model = follow(RodWinding(config), 5.7, parallel(places, 0.4))
    theta, _, height = laid(model)
    for turn in (4, 5):
        at = np.linspace(turn + 0.15, turn + 0.5, 100) * TURN
        # The specification's bar; between flanks so flat the springs give way by 0.007 d.
        assert np.interp(at, theta, height) == pytest.approx(math.sqrt(1 - pitch**2 / 4), abs=0.01)
    assert abs(model.energy.balance_pct) < 0.1


@pytest.mark.campaign
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("pitch", "friction", "within"),
    # Friction of 1 holds cable where it lands: all of it lies within the specification's bar. With
    # the paper's friction gaps close and cable falls through those that open: turns that leap at
    # another angle are farther apart there, 0.10 and 0.13 of the second layer.
    [(1.1, 1.0, 1.0), (1.1, 0.1, 0.85), (1.3, 0.1, 0.8)],
)
def test_turns_come_to_lie_as_in_a_dense_solution(pitch, friction, within):
    turns = 5.5
    between = drum(turns * pitch + 1.0)
    # Cable that gives way for as long as it is wound over must not rest.
    model = wound(2 * turns, pitch * DIAMETER, between, friction=friction, rests=friction > 0.5)
    theta, z, height = laid(model)
    assert abs(model.energy.balance_pct) < 0.1
    resolved, width = model.config.resolved, turns * pitch
    bending = resolved.constants.bending / (resolved.tension * DIAMETER**2)
    dense = dense_lay(
        2 * turns,
        np.array(
            [[0.0, turns * TURN, 2 * turns * TURN, 3 * turns * TURN], [0.0, width, 0.0, width]]
        ),
        radius=RHO / DIAMETER,
        span=model.config.free_length / DIAMETER,
        bending=bending,
        friction=friction,
        between=(0.0, width),
    )
    for layer in (0, 1):
        at = inner(layer, turns)
        aside = np.interp(at, theta, z) - np.interp(at, dense[0], dense[1])
        up = np.interp(at, theta, height) - np.interp(at, dense[0], dense[2]) + RHO / DIAMETER
        # The specification's bar.
        assert (np.hypot(aside, up) < 0.1).mean() >= within


@pytest.mark.slow
def test_cable_that_slides_over_cable_leaves_the_ledger_closed():
    turns, pitch = 3.5, 1.2
    model = wound(3 * turns, pitch * DIAMETER, drum(turns * pitch + 1.0), friction=0.1)
    # The specification's bar; a surface that moved at every look had it open by 0.4 to 2 %.
    assert abs(model.energy.balance_pct) < 0.1


@pytest.mark.slow
def test_flanges_hold_the_cable(layers):
    _, z, _ = laid(layers)
    # A flange gives way by as much as the cable is pressed against it.
    assert z.min() > -0.03
    assert z.max() < 5.53


@pytest.mark.slow
def test_layers_come_to_rest_and_their_energy_is_counted(layers):
    # As many nodes as with one layer: the free span's, those that stay awake, and their turn.
    assert layers.live_nodes < 70
    # The specification's bar.
    assert abs(layers.energy.balance_pct) < 0.1


@pytest.mark.slow
def test_memory_grows_evenly_with_the_cable(layers):
    crossings = layers._wound._count / layers.cylinder_angle * TURN
    assert crossings == pytest.approx(128.0, rel=0.15)


def test_the_end_of_the_cable_is_passed_without_a_jump():
    assert abs(wound(1.2, 0.9 * DIAMETER, drum(20)).energy.balance_pct) < 0.1


def test_unwinding_brings_the_cable_below_to_light():
    surface, apart = WoundSurface(DIAMETER), DIAMETER
    theta = np.linspace(0.0, 3.0 * TURN, 200)
    z = np.full_like(theta, 0.01)
    height = RHO + apart * np.floor(theta / TURN + 1.0e-9)
    surface.lay(np.stack([theta, z, height]))
    node = np.array([[3.25 * TURN], [0.01], [RHO + 2.9 * apart]])
    free, flat = np.array([True]), np.zeros(1)
    assert surface.below(node, flat, free).below[0, 0] == pytest.approx(RHO + 2.0 * apart)
    surface.lift(2.0 * TURN)
    node = np.array([[2.25 * TURN], [0.01], [RHO + 1.9 * apart]])
    assert surface.below(node, flat, free).below[0, 0] == pytest.approx(RHO + apart)
    surface.lift(0.0)
    assert surface.below(node, flat, free).below.shape == (0, 1)


def test_layers_up_to_the_guide_are_refused_beforehand():
    # Three layers of 6.5 turns lie up to 25.9 mm from the axis, the guide stands at 22.7 mm.
    config = WindingConfig(case=CASE, free_length=0.015, drum=drum(6.5))
    with pytest.raises(ValueError, match=r"the guide stands 22\.67 mm away"):
        PlannedRun(config=config, duration=70.0)


def test_cable_that_lies_up_to_the_guide_is_refused():
    # The third turn on turns lies 25 mm from the axis.
    config = WindingConfig(case=CASE, free_length=0.015, segment_length=0.003)
    with pytest.raises(ImpossibleResultError, match="lies up to the guide"):
        follow(RodWinding(config), 4, lambda _angle: (0.0, 0.0))


def test_the_solid_refuses_a_drum():
    with pytest.raises(ValueError, match="bare cylinder: leave out the drum"):
        PlannedRun(config=WindingConfig(case=CASE, drum=drum(5)), element="solid")


def test_a_drum_of_another_radius_is_refused():
    other = replace(drum(5), radius=0.02)
    with pytest.raises(ValueError, match=r"the cylinder's of 0\.015 m, got 0\.02 m"):
        WindingConfig(case=CASE, drum=other)
