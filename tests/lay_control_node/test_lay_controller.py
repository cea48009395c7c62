"""The controller as a whole: modes, fall-backs, and no step in any of them."""

import math

import numpy as np
import pytest

from lay_control_node.control.guide_law import AxisBounds, GuideLaw, WantedPoint
from lay_control_node.control.lay_controller import (
    ControllerConfig,
    LayController,
    Setpoint,
)
from lay_control_node.control.lay_filter import LayFilter, LayFilterConfig
from lay_control_node.control.stretch_filter import StretchFilter
from lay_control_node.planning.lay_on import LayOnLaw
from winding_core.cable_parameters import published_case
from winding_core.lay_control_records import ControlBasis, ControlMode
from winding_core.lay_records import LAY_DTYPE
from winding_core.material_law import MaterialLaw
from winding_core.readings import AxisReading

CASE = published_case(4, "case")
RADIUS = CASE.centreline_radius
OMEGA, FEED = 1.74, 5.0e-3
ADVANCE = FEED / OMEGA
PERIOD = 0.02


class EvenHelix:
    """An even helix of the drive programme's pitch."""

    def at(self, theta: float) -> WantedPoint:
        """Return what is wanted at a wound angle [rad]."""
        return WantedPoint(z=ADVANCE * theta, slope=ADVANCE, curvature=0.0)


def controller(*, patience: float = math.inf) -> LayController:
    """Return a controller of case 4 that drives the guide."""
    law = LayOnLaw(CASE, MaterialLaw(law="neo_hookean"))
    return LayController(
        config=ControllerConfig(
            advance_per_radian=ADVANCE,
            bending_stiffness=1.0e-9,
            guide=AxisBounds(low=-0.1, high=1.0, speed=0.08, acceleration=0.5),
            solver_patience=patience,
        ),
        wanted=EvenHelix(),
        law=GuideLaw(radius=RADIUS),
        lay=LayFilter(LayFilterConfig(radius=RADIUS, free_length=0.198)),
        stretch=StretchFilter(law, spacing=CASE.marker_spacing, radius=RADIUS),
        mode=ControlMode.DRIVE,
    )


class Machine:
    """A carriage that follows its command, and a cable that follows over a true length [m]."""

    def __init__(self, control: LayController, length: float) -> None:
        self.control, self.length = control, length
        self.t = self.guide = self.speed = self.theta = self.z = 0.0
        self.lay: list[tuple[float, float]] = [(0.0, 0.0)]
        self.setpoints: list[Setpoint] = []

    def wind(self, duration: float, *, seen: bool = True, solved: bool = True) -> None:
        """Wind for a time [s], with or without tracker and solver."""
        for _ in range(round(duration / PERIOD)):
            self.t += PERIOD
            omega = OMEGA * min(self.t, 1.0)
            turned = omega * PERIOD
            kept = math.exp(-turned * RADIUS / self.length)
            self.z = self.guide + (self.z - self.guide) * kept
            self.theta += turned
            self.lay.append((self.theta, self.z))
            if seen:
                self.control.take_lay(self._places())
            if solved:
                self.control.take_solver(self.t)
            reading = AxisReading(
                cylinder_angle=self.theta,
                angular_speed=omega,
                carriage_position=self.guide,
                feed_speed=self.speed,
            )
            setpoint = self.control.advance(self.t, reading, CASE.weight)
            self.setpoints.append(setpoint)
            self.guide, self.speed = setpoint.guide, setpoint.guide_speed

    def error(self) -> float:
        """Return what the cable lies before its wanted place at the contact line [m]."""
        return self.z - ADVANCE * self.theta

    def _places(self) -> np.ndarray:
        theta, z = np.array(self.lay).T
        at = np.arange(0.0873, self.theta - 0.1, 0.0873)
        places = np.zeros(at.size, dtype=LAY_DTYPE)
        places["theta"], places["z"] = at, np.interp(at, theta, z)
        places["sigma_z"] = 3.0e-5
        return places


@pytest.mark.parametrize("length", [0.16, 0.198, 0.23])
def test_the_cable_lands_on_the_helix_whatever_the_free_length(length):
    machine = Machine(controller(), length)
    machine.wind(6.0)
    # Two of the 0.03 mm that heights are known by.
    assert abs(machine.error()) < 6.0e-5


def test_without_a_tracker_it_goes_on_by_what_it_knows():
    machine = Machine(controller(), 0.17)
    machine.wind(6.0)
    before = len(machine.setpoints)
    machine.wind(8.0, seen=False)
    steps = np.diff([s.guide for s in machine.setpoints[before - 2 :]])
    assert machine.setpoints[-1].basis is ControlBasis.MODEL
    # What the feed makes in a period, and a tenth of a millimetre.
    assert np.abs(steps).max() < FEED * PERIOD + 1.0e-4
    assert abs(machine.error()) < 1.0e-3


def test_without_a_solver_the_guide_follows_the_drive_programme():
    machine = Machine(controller(patience=1.0), 0.17)
    machine.wind(6.0)
    before = len(machine.setpoints)
    machine.wind(4.0, solved=False)
    speeds = [s.guide_speed for s in machine.setpoints[before:]]
    steps = np.diff([s.guide for s in machine.setpoints[before - 1 :]])
    assert machine.setpoints[-1].basis is ControlBasis.RAMP
    assert speeds[-1] == pytest.approx(FEED)
    assert np.abs(steps).max() < FEED * PERIOD + 1.0e-4


def test_taking_over_in_mid_run_makes_no_step():
    control = controller()
    control.mode = ControlMode.WATCH
    machine = Machine(control, 0.17)
    for _ in range(300):
        machine.wind(PERIOD)
        machine.guide, machine.speed = FEED * max(machine.t - 0.5, 0.0), FEED
    control.mode = ControlMode.DRIVE
    # 15 mm are made up at 2.5 mm per radian, which the carriage can; the rest dies out after that.
    machine.wind(12.0)
    speeds = np.array([s.guide_speed for s in machine.setpoints[299:]])
    assert np.abs(np.diff(speeds)).max() <= 0.5 * PERIOD * (1.0 + 1.0e-9)
    assert abs(machine.error()) < 1.0e-4


def test_setpoint_waits_for_a_carriage_that_stands_and_goes_on_with_it():
    machine = Machine(controller(), 0.198)
    machine.wind(6.0)
    stood = machine.guide
    for _ in range(400):
        machine.wind(PERIOD)
        machine.guide, machine.speed = stood, 0.0
    # The default following error, and what the carriage's own speed takes to brake.
    assert machine.setpoints[-1].ahead == pytest.approx(0.02, abs=1.0e-3)
    assert machine.setpoints[-1].limited
    machine.wind(20.0)
    assert abs(machine.error()) < 1.0e-4


def test_no_pull_is_commanded_without_a_brake():
    machine = Machine(controller(), 0.198)
    machine.wind(1.0)
    assert all(s.pull is None for s in machine.setpoints)
