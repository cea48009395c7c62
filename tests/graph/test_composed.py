"""One composed run: all four nodes in this process, on one executor."""

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from cable_winding.drive import DriveProfile
from cable_winding.markers import CORRECTED_DTYPE, MARKER_DTYPE, is_wound
from cable_winding.published import published_markers
from cable_winding.ros import topics
from cable_winding.ros.cloud_messages import decode_cloud
from cable_winding.ros.rig_messages import decode_joint_state
from winding_bringup.composed import ComposedGraph
from winding_bringup.graph import expected_subscribers, pace_topics
from winding_bringup.recorder import Recorder, Tape

# Long enough for P1 of case 4, wound at 6.28 rad, 4.1 s.
DURATION = 5.0


@pytest.fixture(scope="module")
def tape(request: pytest.FixtureRequest) -> Tape:
    ros = request.getfixturevalue("module_ros")
    listener = ros.plain("recorder_host")
    recorded = [topic for topic in topics.TOPICS if topic.recorded]
    recorder = Recorder(listener, None, recorded=recorded)
    condition = {"case": 4, "duration": DURATION}
    parameters = {name: dict(condition) for name in ("cable_fem", "marker_tracker", "correction")}
    parameters["winding_rig"] = {
        **condition,
        "speed": 0.0,
        "pace_topics": ",".join(topic.name for topic in pace_topics()),
    }
    graph: ComposedGraph | None = None
    try:
        graph = ComposedGraph(ros.context, ros.executor, namespace="", parameters=parameters)
        expected = expected_subscribers(frozenset(topic.name for topic in recorded))
        ros.spin_until(
            lambda: all(
                graph.nodes[node].matched(topic) >= count
                for node, counts in expected.items()
                for topic, count in counts.items()
            )
        )
        assert ros.call(listener, Trigger, "rig/start", Trigger.Request()).success
        ros.spin_until(
            lambda: all(
                recorder.tape.last_stamp(topic) > DURATION - 1.0 / topic.rate
                for topic in (
                    topics.JOINT_STATES,
                    topics.TRACKED_MARKERS,
                    topics.FEM_MARKERS,
                    topics.CORRECTED_MARKERS,
                )
                if topic.rate is not None
            ),
            patience=200.0,
        )
    finally:
        if graph is not None:
            graph.close()
        recorder.close()
    return recorder.tape


def decoded(tape: Tape, topic: topics.Topic, dtype: np.dtype = MARKER_DTYPE) -> list:
    return [
        decode_cloud(deserialize_message(message.data, topic.type), dtype)
        for message in tape.messages[topic.name]
    ]


def test_every_encoder_sample_and_frame_is_answered(tape: Tape) -> None:
    joints = [message.stamp_ns for message in tape.messages["rig/joint_states"]]
    assert joints == [sample * 1_000_000 for sample in range(int(DURATION * 1000) + 1)]
    frames = [message.stamp_ns for message in tape.messages["camera/camera_info"]]
    assert frames == [frame * 5_000_000 for frame in range(int(DURATION * 200) + 1)]
    assert [message.stamp_ns for message in tape.messages["tracker/markers"]] == frames


def test_machine_follows_the_drive_profile(tape: Tape) -> None:
    message = tape.last(topics.JOINT_STATES)
    assert message is not None
    t, reading = decode_joint_state(deserialize_message(message.data, topics.JOINT_STATES.type))
    angle, guide = DriveProfile().positions(t)
    # The bound that the machine's own test measures.
    assert reading.cylinder_angle == pytest.approx(angle, abs=0.01)
    assert reading.carriage_position == pytest.approx(guide, abs=1e-4)


def test_first_marker_is_measured_where_the_paper_measured_it(tape: Tape) -> None:
    published = published_markers(4)[0].experiment
    assert published is not None
    _, markers = decoded(tape, topics.TRACKED_MARKERS)[-1]
    first = markers[markers["id"] == 1]
    assert is_wound(first).all()
    assert first["s"][0] == pytest.approx(published.s, rel=0.01)


def test_later_markers_are_not_invented(tape: Tape) -> None:
    for _, markers in decoded(tape, topics.TRACKED_MARKERS):
        assert not is_wound(markers[markers["id"] >= 2]).any()


def test_correction_is_the_weight_times_the_prediction(tape: Tape) -> None:
    fem = dict(decoded(tape, topics.FEM_MARKERS))
    corrected = decoded(tape, topics.CORRECTED_MARKERS, CORRECTED_DTYPE)
    assert len(corrected) == len(fem)
    for t, markers in corrected:
        wound = fem[t][is_wound(fem[t])]
        np.testing.assert_array_equal(markers["s_fem"], wound["s"])
        np.testing.assert_allclose(markers["s"], markers["h"] * markers["s_fem"], rtol=1e-12)
        assert (markers["s_low"] <= markers["s"]).all()
        assert (markers["s"] <= markers["s_high"]).all()


def test_whole_run_is_predicted_at_activation(tape: Tape) -> None:
    ((t, markers),) = decoded(tape, topics.FEM_PREDICTION)
    assert t == 0.0
    # In 5 s the cylinder turns 7.83 rad: P1 is wound, the others are not.
    np.testing.assert_array_equal(is_wound(markers), [True, True, False, False, False])
