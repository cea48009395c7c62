"""When a run is over for everybody who follows it."""

from __future__ import annotations

import math

from cable_winding.ros import topics
from cable_winding.ros.topics import Topic
from winding_bringup.recorder import Tape

# Frames may be lost at the very end of a run: nothing more comes after so long.
_LAST_FRAMES = 1.0


class RunEnd:
    """Tells when each room has dealt with a run's last sample.

    Args:
        duration: Simulated length of the run [s].
    """

    def __init__(self, duration: float) -> None:
        self._duration = duration
        self._last_frame = -1.0
        self._since = math.inf

    def reached(self, tape: Tape, now: float) -> bool:
        """Return whether the tape has everything, as far as wall time `now` [s] can tell."""
        followers = (topics.JOINT_STATES, topics.FEM_MARKERS, topics.CORRECTED_MARKERS)
        if not all(self._ends(topic, tape) for topic in followers):
            return False
        if self._ends(topics.CAMERA_INFO, tape) and self._ends(topics.TRACKED_MARKERS, tape):
            return True
        # The camera may have lost its last frames: then the one before has to be answered.
        frame = tape.last_stamp(topics.TRACKED_MARKERS)
        if frame != self._last_frame:
            self._last_frame, self._since = frame, now
        return now - self._since >= _LAST_FRAMES

    def _ends(self, topic: Topic, tape: Tape) -> bool:
        assert topic.rate is not None
        return tape.last_stamp(topic) > self._duration - 1.0 / topic.rate
