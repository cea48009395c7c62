"""The fast path: the rig hands its frames to a tracker in the same process."""

from typing import Any

import pytest
from std_srvs.srv import Trigger

from winding_recorder.live.recorder import Recorder
from winding_ros import topics
from winding_ros.graph import GRAPH, expected_subscribers

pytestmark = pytest.mark.slow


def test_frames_handed_over_in_process_are_all_tracked(ros: Any, compose: Any) -> None:
    listener = ros.plain("recorder_host")
    recorder = Recorder(listener, None, recorded=[t for t in topics.TOPICS if t.recorded])
    graph = None
    try:
        condition = {"case": 4, "duration": 1.0}
        graph = compose(
            ros,
            {
                **{spec.name: condition for spec in GRAPH},
                topics.RIG: {**condition, "speed": 0.0, "pace_topics": "tracker/markers"},
            },
            direct_frames=True,
        )
        rig = graph.nodes[topics.RIG]
        images: list[bytes] = []
        topics.IMAGE.subscribe(listener, images.append, raw=True)
        heard = ("rig/joint_states", "camera/camera_info", "camera/image_raw/compressed")
        ros.spin_until(lambda: all(rig.matched(name) >= 1 for name in heard))
        recorded = frozenset(topic.name for topic in topics.TOPICS if topic.recorded)
        wanted = expected_subscribers(recorded)[topics.TRACKER]["tracker/markers"]
        ros.spin_until(lambda: graph.nodes[topics.TRACKER].matched("tracker/markers") == wanted)
        assert ros.call(listener, Trigger, "rig/start", Trigger.Request()).success
        ros.spin_until(lambda: recorder.buffer.last_stamp(topics.TRACKED_MARKERS) >= 1.0)
    finally:
        if graph is not None:
            graph.close()
        recorder.close()
    stamps = [message.stamp_ns for message in recorder.buffer.messages["tracker/markers"]]
    assert stamps == [frame * 5_000_000 for frame in range(201)]
    assert images == []
