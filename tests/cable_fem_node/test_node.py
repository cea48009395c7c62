"""The solver's node: follows the machine's messages, publishes the results of its core."""

import itertools
from typing import Any

import numpy as np
import pytest
from rods import CASE, CONFIG, follow
from solver_bench import FAILURE, SolverBench, heard_by, solver_node

from cable_fem_node.winding.rod_winding import RodWinding
from winding_core.markers import CABLE_DTYPE, MARKER_DTYPE, is_wound
from winding_ros import topics
from winding_ros.cloud_messages import decode_cloud

DURATION = 0.5


@pytest.fixture
def followed(ros: Any) -> SolverBench:
    """An active node that has followed half a second of the machine's motion."""
    bench = SolverBench(ros, duration=1.0)
    bench.pull(CASE.weight)
    bench.wind(DURATION, period=1.0e-3)
    assert len(bench.wait_for(topics.FEM_MARKERS, 26)) == 26
    assert len(bench.wait_for(topics.FEM_CABLE, 11)) == 11
    return bench


def test_long_prediction_ends_when_the_process_is_to_end(ros: Any) -> None:
    node = solver_node(ros, duration=500.0)
    asked = itertools.count(1)
    node.told_to_end = lambda: next(asked) > 2
    assert node.trigger_configure() is FAILURE
    assert next(asked) == 4


def test_markers_are_those_of_the_core_at_fifty_hertz_of_the_machine(followed: SolverBench) -> None:
    stamps, markers = zip(*followed.markers(topics.FEM_MARKERS), strict=True)
    np.testing.assert_allclose(stamps, np.arange(26) * 0.02, atol=1e-9)
    model = follow(RodWinding(CONFIG), DURATION, 1.0e-3, CASE.weight)
    np.testing.assert_allclose(markers[-1]["theta"], model.markers()["theta"], rtol=1e-12)


def test_cable_runs_from_the_cylinder_to_the_guide(followed: SolverBench) -> None:
    _, cable = decode_cloud(followed.heard[topics.FEM_CABLE][-1], CABLE_DTYPE)
    # Contact sinks the cable by less than a hundredth of the radius; the positions are float32.
    radius = np.hypot(cable["x"], cable["y"])[0]
    assert radius == pytest.approx(CASE.centreline_radius, rel=0.01)
    assert cable["y"][-1] == pytest.approx(-0.198, rel=1e-6)
    assert (np.diff(cable["s"]) > 0.0).all()
    # Off the cylinder the tension is the dead weight's.
    assert cable["tension"][-1] == pytest.approx(CASE.weight, rel=1e-6)


def test_prediction_is_latched_for_late_subscribers(followed: SolverBench, ros: Any) -> None:
    late = heard_by(ros.plain("late"))[topics.FEM_PREDICTION]
    ros.spin_until(lambda: len(late) == 1)
    _, markers = decode_cloud(late[0], MARKER_DTYPE)
    assert is_wound(markers).tolist() == [True, False, False, False, False]


def test_load_beyond_the_material_s_limit_is_refused_at_configuration(ros: Any) -> None:
    # Hooke on log strain carries no dead load above E / e = 0.956 MPa; case 2 has 1.249 MPa.
    assert solver_node(ros, case=2, law="hencky").trigger_configure() is FAILURE
