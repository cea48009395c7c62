"""A guide that moves across the axis, as one on a robot arm: span, landing, lag, energy."""

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from rods import CASE, CONFIG, DRIVE, tracked

from cable_fem_node.identification.quasi_static import lay
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.solid_winding import SolidWinding
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_model import WindingModel
from winding_core.machine.readings import AxisReading, GuidePlace
from winding_core.markers import Markers
from winding_core.run_inputs import RunHistory

RADIUS = CASE.centreline_radius
FREE = CONFIG.free_length
DURATION = 12.0
Placed = Callable[[float], GuidePlace | None]


def placed(longer: float = 0.0, turned: float = 0.0) -> Placed:
    """Return the guide's place over time: its span grows by a share, and turns by an angle."""

    def at(t: float) -> GuidePlace:
        share = 0.5 - 0.5 * math.cos(math.pi * min(max((t - 3.0) / 5.0, 0.0), 1.0))
        own = GuidePlace.beside(RADIUS, (1.0 + longer * share) * FREE)
        turn = turned * share
        return GuidePlace(
            x=own.x * math.cos(turn) - own.y * math.sin(turn),
            y=own.x * math.sin(turn) + own.y * math.cos(turn),
        )

    return at


def readings(place: Placed) -> Iterator[tuple[float, AxisReading]]:
    for t in np.linspace(0.0, DURATION, 2401).tolist():
        yield t, replace(DRIVE.reading_at(t), guide=place(t))


def wound(place: Placed, config: WindingConfig = CONFIG) -> RodWinding:
    model = RodWinding(config)
    for t, reading in readings(place):
        model.advance_to(t, reading)
    return model


def markers(model: WindingModel) -> Markers:
    return model.markers()[1:4]


@pytest.fixture(scope="module")
def steady() -> RodWinding:
    return wound(lambda _: None)


def test_guide_that_reports_its_own_place_changes_nothing(steady: RodWinding) -> None:
    # The radius of the contact line is not that of the section by some micrometres of sinking.
    same = markers(wound(placed()))
    assert same["theta"] == pytest.approx(markers(steady)["theta"], abs=2.0e-5)
    assert same["z"] == pytest.approx(markers(steady)["z"], abs=2.0e-6)


def test_span_that_changes_by_a_third_lays_by_the_lag_that_it_has(steady: RodWinding) -> None:
    for longer in (0.3, -0.3):
        moved = wound(placed(longer))
        history = RunHistory()
        for t, reading in readings(placed(longer)):
            history.record(t, reading, CASE.weight)
        seen = markers(moved)
        known = tracked(
            theta=np.asarray(seen["theta"]), z=np.asarray(seen["z"]), sigma_theta=1.0e-3
        )
        run = replace(known, inputs=history.inputs)
        theta, z = lay(run, CONFIG.resolved.law)
        steady_run = replace(run, inputs=without_guide(history))
        still_theta, still_z = lay(steady_run, CONFIG.resolved.law)
        # What elements and contact of the rod add to the closed form is the same for both guides.
        added = markers(steady)["z"] - still_z
        assert np.abs(markers(steady)["z"] - seen["z"]).max() > 1.0e-3
        assert seen["z"] - z == pytest.approx(added, abs=1.0e-4)
        assert seen["theta"] - theta == pytest.approx(
            markers(steady)["theta"] - still_theta, abs=1.0e-3
        )
        assert moved.energy.balance_pct < 0.1


def without_guide(history: RunHistory) -> np.ndarray:
    inputs = history.inputs
    inputs["guide_x"] = inputs["guide_y"] = math.nan
    return inputs


def test_guide_that_goes_round_the_cylinder_winds_as_the_cylinder_that_turns_back() -> None:
    turned = 0.5

    def relative(t: float) -> AxisReading:
        reading = DRIVE.reading_at(t)
        place, own = placed(turned=turned)(t), GuidePlace.beside(RADIUS, FREE)
        angle = math.atan2(place.y, place.x) - math.atan2(own.y, own.x)
        return replace(reading, cylinder_angle=reading.cylinder_angle - angle)

    model, times = RodWinding(CONFIG), np.linspace(0.0, DURATION, 2401).tolist()
    for before, t in itertools.pairwise(times):
        reading = relative(t)
        speed = (reading.cylinder_angle - relative(before).cylinder_angle) / (t - before)
        model.advance_to(t, replace(reading, angular_speed=speed))
    # Both frames differ by the inertia of the span alone, and by the speeds between readings.
    around = markers(wound(placed(turned=turned)))
    assert around["theta"] == pytest.approx(markers(model)["theta"], abs=3.0e-4)
    assert around["z"] == pytest.approx(markers(model)["z"], abs=3.0e-5)


def test_guide_inside_the_wound_cable_is_refused() -> None:
    reading = replace(DRIVE.reading_at(0.0), guide=GuidePlace(x=0.5 * RADIUS, y=0.0))
    with pytest.raises(ValueError, match=r"the guide must stand more than .* off the axis"):
        RodWinding(CONFIG).advance_to(0.0, reading)


def test_solid_element_refuses_a_guide_that_moves() -> None:
    model = SolidWinding(replace(CONFIG, segment_length=4.0e-3), wind=0.5)
    with pytest.raises(ValueError, match=r"keeps its place across the axis.* take element rod"):
        model.advance_to(1.0e-5, replace(DRIVE.reading_at(0.0), guide=placed(0.3)(9.0)))
