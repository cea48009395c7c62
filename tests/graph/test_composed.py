"""One composed run: all four nodes in this process, on one executor."""

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from winding_core.cable.cases import published_markers
from winding_core.machine.drive import DriveProfile
from winding_core.markers import CORRECTED_DTYPE, MARKER_DTYPE, is_wound
from winding_recorder.live.recorder import Recorder, RunBuffer
from winding_ros import topics
from winding_ros.graph import expected_subscribers, pace_topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import decode_joint_state
from winding_ros.topic import Topic

# One process computes what the tests of this file share.
pytestmark = pytest.mark.slow

# Long enough for P1 of case 4, wound at 6.28 rad, 4.1 s.
DURATION = 5.0


@pytest.fixture(scope="module")
def buffer(request: pytest.FixtureRequest) -> RunBuffer:
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
    graph = None
    try:
        graph = request.getfixturevalue("compose")(ros, parameters)
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
                recorder.buffer.last_stamp(topic) > DURATION - 1.0 / topic.rate
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
    return recorder.buffer


def decoded(buffer: RunBuffer, topic: Topic, dtype: np.dtype = MARKER_DTYPE) -> list:
    return [
        decode_cloud(deserialize_message(message.data, topic.type), dtype)
        for message in buffer.messages[topic.name]
    ]


def test_every_encoder_sample_and_frame_is_answered(buffer: RunBuffer) -> None:
    joints = [message.stamp_ns for message in buffer.messages["rig/joint_states"]]
    assert joints == [sample * 1_000_000 for sample in range(int(DURATION * 1000) + 1)]
    frames = [message.stamp_ns for message in buffer.messages["camera/camera_info"]]
    assert frames == [frame * 5_000_000 for frame in range(int(DURATION * 200) + 1)]
    assert [message.stamp_ns for message in buffer.messages["tracker/markers"]] == frames


def test_machine_follows_the_drive_profile(buffer: RunBuffer) -> None:
    message = buffer.last(topics.JOINT_STATES)
    assert message is not None
    t, reading = decode_joint_state(deserialize_message(message.data, topics.JOINT_STATES.type))
    angle, guide = DriveProfile().positions(t)
    # The bound that the machine's own test measures.
    assert reading.cylinder_angle == pytest.approx(angle, abs=0.01)
    assert reading.carriage_position == pytest.approx(guide, abs=1e-4)


def test_first_marker_is_measured_where_the_paper_measured_it(buffer: RunBuffer) -> None:
    published = published_markers(4)[0].experiment
    assert published is not None
    _, markers = decoded(buffer, topics.TRACKED_MARKERS)[-1]
    first = markers[markers["id"] == 1]
    assert is_wound(first).all()
    assert first["s"][0] == pytest.approx(published.s, rel=0.01)


def test_later_markers_are_not_invented(buffer: RunBuffer) -> None:
    for _, markers in decoded(buffer, topics.TRACKED_MARKERS):
        assert not is_wound(markers[markers["id"] >= 2]).any()


def test_correction_is_the_weight_times_the_prediction(buffer: RunBuffer) -> None:
    fem = dict(decoded(buffer, topics.FEM_MARKERS))
    corrected = decoded(buffer, topics.CORRECTED_MARKERS, CORRECTED_DTYPE)
    assert len(corrected) == len(fem)
    for t, markers in corrected:
        wound = fem[t][is_wound(fem[t])]
        np.testing.assert_array_equal(markers["s_fem"], wound["s"])
        np.testing.assert_allclose(markers["s"], markers["h"] * markers["s_fem"], rtol=1e-12)
        assert (markers["s_low"] <= markers["s"]).all()
        assert (markers["s"] <= markers["s_high"]).all()


def test_whole_run_is_predicted_at_activation(buffer: RunBuffer) -> None:
    ((t, markers),) = decoded(buffer, topics.FEM_PREDICTION)
    assert t == 0.0
    # In 5 s the cylinder turns 7.83 rad: P1 is wound, the others are not.
    np.testing.assert_array_equal(is_wound(markers), [True, True, False, False, False])
