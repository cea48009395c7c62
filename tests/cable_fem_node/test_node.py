"""The solver's node: follows the machine's messages, publishes what its core says."""

import itertools
from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from cable_fem_node.node import CableFemNode
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile
from winding_core.markers import CABLE_DTYPE, MARKER_DTYPE, is_wound
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import encode_joint_state, encode_tension

DURATION = 0.5
DRIVE = DriveProfile()


def overrides(**values: object) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in values.items()]


class Heard:
    """Everything a probe hears of the solver."""

    def __init__(self, probe: Any) -> None:
        self.markers: list[Any] = []
        self.cable: list[Any] = []
        self.prediction: list[Any] = []
        for topic, store in (
            (topics.FEM_MARKERS, self.markers),
            (topics.FEM_CABLE, self.cable),
            (topics.FEM_PREDICTION, self.prediction),
        ):
            topic.subscribe(probe, store.append)


@pytest.fixture
def follows(ros: Any) -> tuple[Any, Heard]:
    """Drive an active node through half a second of machine motion."""
    node = ros.add(CableFemNode, parameter_overrides=overrides(case=4, duration=1.0))
    probe = ros.plain()
    heard = Heard(probe)
    joints = topics.JOINT_STATES.advertise(probe)
    tension = topics.TENSION.advertise(probe)
    assert node.trigger_configure() is TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    ros.spin_until(lambda: joints.get_subscription_count() == tension.get_subscription_count() == 1)
    ros.spin_until(lambda: node.matched("fem/markers") == node.matched("fem/cable") == 1)
    tension.publish(encode_tension(0.0, paper_case(4).weight))
    for sample in range(int(DURATION * 1000) + 1):
        joints.publish(encode_joint_state(sample * 1e-3, DRIVE.reading_at(sample * 1e-3)))
    ros.spin_until(lambda: len(heard.markers) == 26 and len(heard.cable) == 11)
    return node, heard


def test_long_prediction_ends_when_the_process_is_told_to_end(ros: Any) -> None:
    node = ros.add(CableFemNode, parameter_overrides=overrides(case=4, duration=500.0))
    asked = itertools.count(1)
    node.stop_requested = lambda: next(asked) > 2
    assert node.trigger_configure() is TransitionCallbackReturn.FAILURE
    assert next(asked) == 4


def test_markers_come_at_fifty_hertz_with_the_machine_s_stamps(follows: Any) -> None:
    stamps = [decode_cloud(message, MARKER_DTYPE)[0] for message in follows[1].markers]
    np.testing.assert_allclose(stamps, np.arange(26) * 0.02, atol=1e-9)


def test_published_markers_are_those_of_the_core(follows: Any) -> None:
    model = RodWinding(WindingConfig(case=paper_case(4)))
    for sample in range(int(DURATION * 1000) + 1):
        t = sample * 1e-3
        model.advance_to(t, DRIVE.reading_at(t), paper_case(4).weight)
    _, markers = decode_cloud(follows[1].markers[-1], MARKER_DTYPE)
    np.testing.assert_allclose(markers["theta"], model.markers()["theta"], rtol=1e-12)


def test_cable_runs_from_the_cylinder_to_the_guide(follows: Any) -> None:
    _, cable = decode_cloud(follows[1].cable[-1], CABLE_DTYPE)
    rho = paper_case(4).centreline_radius
    # Contact sinks the cable by less than a hundredth of the radius; the positions are float32.
    assert np.hypot(cable["x"], cable["y"])[0] == pytest.approx(rho, rel=0.01)
    assert cable["y"][-1] == pytest.approx(-0.198, rel=1e-6)
    assert (np.diff(cable["s"]) > 0.0).all()
    # Off the cylinder the tension is the dead weight's.
    assert cable["tension"][-1] == pytest.approx(paper_case(4).weight, rel=1e-6)


def test_prediction_is_latched_for_who_comes_late(follows: Any, ros: Any) -> None:
    late = Heard(ros.plain("late"))
    ros.spin_until(lambda: len(late.prediction) == 1)
    _, markers = decode_cloud(late.prediction[0], MARKER_DTYPE)
    assert is_wound(markers).tolist() == [True, False, False, False, False]


def test_load_beyond_the_material_s_limit_is_refused_at_configuration(ros: Any) -> None:
    # Hooke on log strain carries no dead load above E / e = 0.956 MPa; case 2 has 1.249 MPa.
    node = ros.add(CableFemNode, parameter_overrides=overrides(case=2, law="hencky"))
    assert node.trigger_configure() is TransitionCallbackReturn.FAILURE
