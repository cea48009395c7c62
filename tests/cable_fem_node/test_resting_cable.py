"""Turns that rest on the cylinder: the rod that does not integrate them against one that does."""

import copy
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from axis_readings import axis_reading
from rods import CASE, CONFIG, DRIVE, follow

from cable_fem_node.dynamics.state import empty_points
from cable_fem_node.winding.resting_cable import RestingCable
from cable_fem_node.winding.rod_nodes import RodNodes
from cable_fem_node.winding.rod_winding import RodWinding
from winding_core.machine.readings import AxisReading

WEIGHT = CASE.weight
SPEED = DRIVE.angular_speed
# What docs/solver.md promises: 0.02 mm, 1e-4 rad, 0.1 % of the span tension, 10 um of length.
# Measured are 1e-11 m and 1e-7 N; the rest is for rounding, which landing cable amplifies.
Z_BAR = 2.0e-5
THETA_BAR = 1.0e-4
TENSION_BAR = 1.0e-3 * WEIGHT
S_BAR = 1.0e-5
# The free span, what stays awake of the wound cable, and a block that waits for its second look.
MOST_LIVE = 36 + 20 + 4 + 16


class Machine:
    """Winds the same cable twice: with resting turns, and with every turn integrated."""

    def __init__(self, **config: Any) -> None:
        self.resting = RodWinding(replace(CONFIG, **config))
        self.integrated = RodWinding(replace(CONFIG, **{**config, "rests": False}))
        self.models = (self.resting, self.integrated)
        self._t, self._angle, self._speed, self._tension = 0.0, 0.0, 0.0, WEIGHT

    def wind(self, seconds: float, speed: float = SPEED, tension: float = WEIGHT) -> None:
        """Go on: speed and tension change linearly in the first tenth of the time."""
        begin, speed0, tension0 = self._t, self._speed, self._tension
        period = 5.0e-3
        for i in range(1, round(seconds / period) + 1):
            share = min(1.0, 10.0 * period * i / seconds)
            before, self._speed = self._speed, speed0 + share * (speed - speed0)
            self._tension = tension0 + share * (tension - tension0)
            self._angle += 0.5 * (before + self._speed) * period
            self._t = begin + period * i
            for model in self.models:
                model.advance_to(self._t, self._reading(), self._tension)

    def _reading(self) -> AxisReading:
        advance = DRIVE.advance_per_radian
        return axis_reading(
            self._angle, advance * self._angle, speed=self._speed, feed=advance * self._speed
        )

    def agree(self) -> None:
        """Assert that the two cannot be distinguished."""
        one, other = self.models
        (s, theta, z), (s2, theta2, z2) = one.wound_path(), other.wound_path()
        # A marker that lies on a node has landed or not: that must not depend on rounding.
        np.testing.assert_array_equal(s, s2)
        np.testing.assert_allclose(theta, theta2, rtol=0.0, atol=THETA_BAR)
        np.testing.assert_allclose(z, z2, rtol=0.0, atol=Z_BAR)
        wound = slice(1, s.size)
        tension, tension2 = (model.cable()["tension"][wound] for model in self.models)
        np.testing.assert_allclose(tension, tension2, rtol=0.0, atol=TENSION_BAR)
        for name, bar in (("theta", THETA_BAR), ("z", Z_BAR), ("s", S_BAR), ("flags", 0)):
            values, values2 = (model.markers()[name] for model in self.models)
            np.testing.assert_allclose(values, values2, rtol=0.0, atol=bar)


@pytest.fixture(scope="module")
def long_run() -> Machine:
    machine = Machine()
    machine.wind(30.0)
    return machine


@pytest.mark.slow
def test_resting_turns_change_nothing_over_a_long_run(long_run: Machine) -> None:
    long_run.agree()
    one, other = (model.wound_stretch() for model in long_run.models)
    assert one == pytest.approx(other, rel=1.0e-6)


def test_integrated_cable_does_not_grow_with_the_wound(long_run: Machine) -> None:
    model, other = long_run.models
    assert model.nodes == other.nodes == other.live_nodes
    assert model.nodes > 2 * MOST_LIVE
    assert model.live_nodes <= MOST_LIVE
    assert model.element_steps < 0.7 * other.element_steps


def test_energies_of_resting_turns_are_counted(long_run: Machine) -> None:
    one, other = (model.energy for model in long_run.models)
    # The integrator's own error; with every turn integrated it is the same.
    assert one.balance_pct < 0.1
    for name in ("kinetic", "internal", "contact", "external", "friction"):
        # Measured are 1e-6 of what the surface did, and 6e-8 of the heat of friction.
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1.0e-3)


def test_integrated_cable_does_not_creep_over_the_cylinder() -> None:
    machine = Machine()
    machine.wind(8.0)
    laid = machine.integrated._nodes.place(20, machine._angle)
    machine.wind(8.0)
    # Of 2e5 steps every one adds the last place of a number of 17 mm at random; springs that took
    # the angle for its chord crept by 6e-10 m.
    np.testing.assert_allclose(
        machine.integrated._nodes.place(20, machine._angle), laid, rtol=0.0, atol=1.0e-11
    )


def test_room_for_nodes_that_runs_out_changes_nothing() -> None:
    machine = Machine(segment_length=8.0e-3, rests=False)
    one, other = machine.models
    room = one._nodes.touching.size
    other._nodes.grow(2 * room)
    machine.wind(14.0, speed=2.0 * SPEED)
    assert one.live_nodes > room
    # An element that was cut a step late left 1e-9 m and 1e-5 of the heat of friction behind.
    np.testing.assert_allclose(one._nodes.position, other._nodes.position, rtol=0.0, atol=1.0e-11)
    assert one.energy.friction == pytest.approx(other.energy.friction, rel=1.0e-6)


def test_resting_markers_turn_with_the_cylinder(long_run: Machine) -> None:
    model = long_run.resting
    cable, markers = model.cable(), model.markers()
    angle = model.cylinder_angle
    start = CONFIG.resolved.constants.start_radius
    assert cable["x"][0] == pytest.approx(start * math.cos(angle), abs=1.0e-12)
    assert cable["y"][0] == pytest.approx(start * math.sin(angle), abs=1.0e-12)
    place = 0.1 * markers["id"]
    x, y = (np.interp(place, cable["s"], cable[name]) for name in "xy")
    apart = np.arctan2(y, x) - (angle - markers["theta"])
    # A marker lies on the chord between two nodes, 0.33 rad apart.
    assert np.abs(np.remainder(apart + math.pi, math.tau) - math.pi).max() < 3.0e-3


def test_copy_winds_on_by_itself(long_run: Machine) -> None:
    one = copy.deepcopy(long_run.resting)
    other = copy.deepcopy(one)
    kept = long_run.resting.cable()
    for model in (one, other):
        follow(model, 31.0, 0.1)
    np.testing.assert_array_equal(one.cable(), other.cable())
    np.testing.assert_array_equal(long_run.resting.cable(), kept)


@pytest.mark.slow
def test_slip_that_goes_deeper_than_what_is_awake_wakes_what_rests() -> None:
    machine = Machine()
    machine.wind(15.0)
    machine.wind(0.5, speed=0.0)
    resting = machine.resting.nodes - machine.resting.live_nodes
    assert resting > 40
    # Slip reaches ln(10) / 0.1 = 23 rad deep, through all that is wound.
    machine.wind(0.3, speed=0.0, tension=0.1 * WEIGHT)
    assert machine.resting.nodes - machine.resting.live_nodes < resting - 20
    machine.agree()
    machine.wind(6.0, tension=0.1 * WEIGHT)
    assert machine.resting.live_nodes <= MOST_LIVE
    machine.agree()


@pytest.mark.parametrize(
    "schedule",
    [
        # Each is (time [s], speed, share of the weight).
        pytest.param(
            [(10.0, SPEED, 0.25), (0.5, 0.0, 0.25), (0.5, 0.0, 1.0)], id="tension rises at a stop"
        ),
        pytest.param(
            [(10.0, SPEED, 1.0), (2.0, 0.0, 1.0), (5.0, SPEED, 1.0)], id="on after a stop"
        ),
        pytest.param([(12.0, SPEED, 1.0), (9.0, -SPEED, 1.0), (6.0, SPEED, 1.0)], id="unwound"),
    ],
)
def test_what_rests_follows_the_machine(schedule: list[tuple[float, float, float]]) -> None:
    machine = Machine()
    for number, (seconds, speed, share) in enumerate(schedule):
        machine.wind(seconds, speed=speed, tension=share * WEIGHT)
        if number:
            machine.agree()
        assert machine.resting.energy.balance_pct < 0.1


@pytest.mark.slow
def test_nothing_rests_once_everything_is_unwound() -> None:
    machine = Machine()
    machine.wind(12.0)
    assert machine.resting.live_nodes < machine.resting.nodes
    machine.wind(1.0, speed=-SPEED)
    machine.wind(machine._angle / SPEED, speed=-SPEED)
    assert machine.resting.nodes == machine.resting.live_nodes
    machine.agree()


def test_newest_cable_is_the_end_of_the_whole(long_run: Machine) -> None:
    model = long_run.resting
    whole = model.cable()
    for turns in (2.0, 5.5, 1000.0):
        newest = model.newest_cable(turns)
        np.testing.assert_array_equal(newest, whole[whole.size - newest.size :])
        theta = model.wound_path()[1]
        left_out = whole.size - newest.size
        assert left_out == min(
            int((theta < theta[-1] - math.tau * turns).sum()), model.nodes - model.live_nodes
        )


def test_newest_cable_brings_all_that_moves() -> None:
    machine = Machine()
    machine.wind(15.0)
    machine.wind(0.5, speed=0.0)
    before = machine.resting.cable()
    awake = machine.resting.newest_cable(0.5)
    # Slip that goes through all that is wound, as in the test above.
    machine.wind(0.3, speed=0.0, tension=0.1 * WEIGHT)
    after, newest = machine.resting.cable(), machine.resting.newest_cable(0.5)
    assert newest.size > awake.size + 20
    left_out = after.size - newest.size
    for name in ("x", "y", "z", "tension"):
        np.testing.assert_array_equal(after[name][:left_out], before[name][:left_out])


def test_node_at_rest_takes_a_hundred_bytes_at_most() -> None:
    store = RestingCable(0.017)
    cable, reference = empty_points(9), np.full(8, 5.0e-3)
    cable.position[0], cable.position[1] = 0.017, -1.0e-3 * np.arange(9)
    while store.count < 30000:
        store.add(8, 0.0, cable, reference)
        # Fewer nodes than there is room for at first are no matter.
        assert store.count < 200 or store.bytes <= 100 * store.count


def test_noise_of_the_load_wakes_nothing() -> None:
    model = RodWinding(CONFIG)
    rng = np.random.default_rng(1)
    # Three times the deviation of the rig's load cell.
    for i, noise in enumerate(0.03 * rng.standard_normal(12000), start=1):
        model.advance_to(1.0e-3 * i, DRIVE.reading_at(1.0e-3 * i), WEIGHT + noise)
    assert model.live_nodes <= MOST_LIVE


def test_cable_that_is_laid_to_rest_and_woken_is_as_it_was() -> None:
    angle, turned = 0.4, np.linspace(0.0, 3.0, 12)
    azimuth = angle - turned
    place = np.array([0.017 * np.cos(azimuth), 0.017 * np.sin(azimuth), 1.0e-3 * turned])
    nodes = RodNodes(place, np.full(11, 5.0e-3))
    rate, step = 1.7, 6.0e-5
    nodes.points.velocity[:2, :12] = rate * np.array([-place[1], place[0]])
    nodes.points.slip[:, :12] = 1.0e-6 * turned
    nodes.points.contact_radius[1:12] = 0.0171
    nodes.points.roll[0, :12] = 0.1 * turned
    nodes.touching[1:12] = 1
    nodes.wake(0, angle, rate * step, step)
    before, tie, touching = nodes.state.copy(), nodes.tie.copy(), nodes.touching.copy()
    nodes.rest(7, angle)
    assert nodes.live == 5
    assert nodes.total == 12
    assert nodes.tie_length == pytest.approx(10.0e-3)
    nodes.wake(7, angle, rate * step, step)
    # The chord of the last step is the velocity there within the step's square.
    np.testing.assert_allclose(nodes.state[:, :12], before[:, :12], atol=1.0e-5)
    still = [row for row in range(12) if row not in (3, 4)]
    np.testing.assert_allclose(nodes.state[still, :12], before[still, :12], atol=1.0e-15)
    np.testing.assert_array_equal(nodes.touching, touching)
    np.testing.assert_allclose(nodes.tie[:2], tie[:2], atol=1.0e-15)
