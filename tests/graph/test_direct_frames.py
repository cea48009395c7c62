"""The fast path: the rig hands its frames to a tracker in the same process."""

from typing import Any

import pytest
from composed_graph import composed_run
from std_srvs.srv import Trigger

from winding_ros import topics

pytestmark = pytest.mark.slow


def test_frames_handed_over_in_process_are_all_tracked(ros: Any, compose: Any) -> None:
    condition = {"case": 4, "duration": 1.0}
    recorded = [topic for topic in topics.TOPICS if topic.recorded]
    images: list[bytes] = []
    with composed_run(compose, ros, condition, recorded) as (listener, recorder):
        topics.IMAGE.subscribe(listener, images.append, raw=True)
        assert ros.call(listener, Trigger, "rig/start", Trigger.Request()).success
        ros.spin_until(lambda: recorder.buffer.last_stamp(topics.TRACKED_MARKERS) >= 1.0)
    stamps = [message.stamp_ns for message in recorder.buffer.messages["tracker/markers"]]
    assert stamps == [frame * 5_000_000 for frame in range(201)]
    assert images == []
