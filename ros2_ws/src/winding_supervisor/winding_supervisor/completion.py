"""When a run is over for everybody who follows it."""

from __future__ import annotations

import math

from winding_recorder.live.recorder import RunBuffer
from winding_ros import topics
from winding_ros.topic import Topic

# Frames may be lost at the very end of a run: nothing more comes after so long.
_LAST_FRAMES = 1.0


class Completion:
    """Says when each node has dealt with a run's last sample.

    Args:
        end: Stamp of the run's end [s].
        camera: Whether frames are tracked.
    """

    def __init__(self, end: float, *, camera: bool = True) -> None:
        self._end = end
        self._camera = camera
        self._last_frame = -1.0
        self._since = math.inf

    def reached(self, buffer: RunBuffer, now: float) -> bool:
        """Return whether the buffer has everything, as far as wall time `now` [s] can tell."""
        followers = (topics.JOINT_STATES, topics.FEM_MARKERS, topics.CORRECTED_MARKERS)
        if not all(self._ends(topic, buffer) for topic in followers):
            return False
        if not self._camera:
            return True
        if self._ends(topics.CAMERA_INFO, buffer) and self._ends(topics.TRACKED_MARKERS, buffer):
            return True
        # The camera may have lost its last frames: then the one before has to be answered.
        frame = buffer.last_stamp(topics.TRACKED_MARKERS)
        if frame != self._last_frame:
            self._last_frame, self._since = frame, now
        return now - self._since >= _LAST_FRAMES

    def _ends(self, topic: Topic, buffer: RunBuffer) -> bool:
        assert topic.rate is not None
        return buffer.last_stamp(topic) > self._end - 1.0 / topic.rate
