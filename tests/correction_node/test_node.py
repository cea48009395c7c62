"""The correction's node: the weight on every prediction, the case on every new measurement."""

from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import TransitionCallbackReturn

from correction_node.live.measured_run import SETTLED_FRAMES as FRAMES
from correction_node.models.dataset import load_data_set
from correction_node.node import CorrectionNode
from winding_core.cable.cases import paper_case, published_markers
from winding_core.markers import CORRECTED_DTYPE, MarkerFlag, wound_markers
from winding_core.status import Level
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud, encode_cloud
from winding_ros.messages.diagnostics import decode_case_votes


def measured(number: int, wound: int) -> np.ndarray:
    """Return the published markers of a case, of which the first `wound` lie on the cylinder."""
    lays = [marker.experiment for marker in published_markers(number)]
    return wound_markers(
        ids=np.arange(1, 5),
        theta=[lay.theta if lay else np.nan for lay in lays],
        z=[lay.z if lay else np.nan for lay in lays],
        radius=paper_case(number).centreline_radius,
        cylinder_angle=0.0,
        flags=[0 if index < wound else MarkerFlag.NOT_WOUND for index in range(4)],
    )


def predicted(number: int) -> np.ndarray:
    """Return the solver's markers of a case, all wound."""
    cells = [cell for cell in load_data_set("rod").cells if cell.case == number]
    markers = measured(number, len(cells))[: len(cells)]
    markers["s"] = [cell.s_fem for cell in cells]
    return markers


class Bench:
    """An active node between a probe's publishers and subscriptions."""

    def __init__(self, ros: Any, **parameters: object) -> None:
        self.node = ros.add(CorrectionNode, parameters=parameters)
        probe = ros.plain()
        self.corrected: list[Any] = []
        self.votes: list[Any] = []
        topics.CORRECTED_MARKERS.subscribe(probe, self.corrected.append)
        topics.CORRECTION_CASE.subscribe(probe, self.votes.append)
        self.fem = topics.FEM_MARKERS.advertise(probe)
        self.tracked = topics.TRACKED_MARKERS.advertise(probe)
        assert self.node.trigger_configure() is TransitionCallbackReturn.SUCCESS
        assert self.node.trigger_activate() is TransitionCallbackReturn.SUCCESS
        ros.spin_until(
            lambda: (
                self.fem.get_subscription_count() == 1
                and self.tracked.get_subscription_count() == 1
                and self.node.matched("correction/markers") == 1
            )
        )


def test_every_prediction_is_answered_with_its_stamp(ros: Any) -> None:
    bench = Bench(ros, case=4)
    for step in range(5):
        bench.fem.publish(encode_cloud(0.02 * step, measured(4, 2)))
    ros.spin_until(lambda: len(bench.corrected) == 5)
    stamps = [decode_cloud(message, CORRECTED_DTYPE)[0] for message in bench.corrected]
    np.testing.assert_allclose(stamps, 0.02 * np.arange(5), atol=1e-9)


def test_case_is_named_when_a_further_marker_is_measured_and_not_before(ros: Any) -> None:
    bench = Bench(ros, case=8)
    ros.spin_until(lambda: len(bench.votes) == 1)
    assert decode_case_votes(bench.votes[0])[1] == {}
    for step, wound in enumerate((0, 0, 1, 1, 3, 3)):
        bench.tracked.publish(encode_cloud(0.1 * step, measured(8, wound)))
    ros.spin_until(lambda: len(bench.votes) == 3)
    stamps = [decode_case_votes(message)[0] for message in bench.votes[1:]]
    assert stamps == pytest.approx([0.2, 0.4])
    # Case 8 stretches like no other: its own published lengths must name it.
    assert next(iter(decode_case_votes(bench.votes[-1])[1])) == 8


def test_measured_markers_correct_those_that_follow_and_are_reported(ros: Any) -> None:
    bench = Bench(ros, case=9)
    assert bench.node.status().values["basis"] == "weight"
    bench.fem.publish(encode_cloud(1.0, predicted(9)))
    ros.spin_until(lambda: len(bench.corrected) == 1)
    for step in range(FRAMES):
        bench.tracked.publish(encode_cloud(1.0 + 0.005 * step, measured(9, 2)))
    ros.spin_until(lambda: bench.node.run.measured.settled == {1, 2})
    bench.fem.publish(encode_cloud(2.0, predicted(9)))
    ros.spin_until(lambda: len(bench.corrected) == 2)
    (_, before), (_, after) = (
        decode_cloud(message, CORRECTED_DTYPE) for message in bench.corrected
    )
    ahead = after["id"] > 2
    assert (after["s"] != before["s"])[ahead].all()
    width_before, width_after = (m["s_high"] - m["s_low"] for m in (before, after))
    assert (width_after < width_before)[ahead].all()
    status = bench.node.status()
    assert status.values["basis"] == "measured P1, P2"
    assert status.level is Level.OK
    assert status.message == "correcting by measured P1, P2"


def test_a_garbage_marker_is_counted_reported_and_moves_no_prediction(ros: Any) -> None:
    bench = Bench(ros, case=9)
    garbage = measured(9, 2)
    garbage["s"][1] = 0.1
    for step in range(FRAMES):
        bench.tracked.publish(encode_cloud(1.0 + 0.01 * step, measured(9, 1)))
        bench.tracked.publish(encode_cloud(1.005 + 0.01 * step, garbage))
    ros.spin_until(lambda: bench.node.run.measured.refused == FRAMES)
    bench.fem.publish(encode_cloud(2.0, predicted(9)))
    ros.spin_until(lambda: bench.corrected)
    status = bench.node.status()
    assert status.level is Level.WARN
    assert f"refused {FRAMES} measured markers, the last: marker 2" in status.message
    assert status.values["basis"] == "measured P1"
    # The garbage does not name a case either: P1 alone was heard.
    assert len(bench.votes) == 2


def test_a_new_activation_forgets_the_last_run(ros: Any) -> None:
    bench = Bench(ros, case=9)
    for step in range(FRAMES):
        bench.tracked.publish(encode_cloud(1.0 + 0.005 * step, measured(9, 2)))
    ros.spin_until(lambda: bench.node.run.measured.settled == {1, 2})
    bench.node.trigger_deactivate()
    bench.node.trigger_activate()
    bench.fem.publish(encode_cloud(0.0, predicted(9)))
    ros.spin_until(lambda: bench.corrected)
    assert bench.node.status().values["basis"] == "weight"


def test_condition_outside_the_trained_ones_is_left_as_predicted_and_reported(ros: Any) -> None:
    bench = Bench(
        ros, case=0, cylinder_diameter=0.2, cable_diameter=0.004, weight=2.0, marker_spacing=0.1
    )
    bench.fem.publish(encode_cloud(1.0, measured(4, 1)))
    ros.spin_until(lambda: bench.corrected)
    assert decode_cloud(bench.corrected[0], CORRECTED_DTYPE)[1]["h"].tolist() == [1.0]
    assert "cylinder" in bench.node.status().message


def test_missing_weights_are_refused(ros: Any) -> None:
    node = ros.add(CorrectionNode, parameters={"weights": "nowhere"})
    assert node.trigger_configure() is TransitionCallbackReturn.FAILURE
