"""When is a run over for every node that follows it?"""

from __future__ import annotations

import math

from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.graph import FEM, RIG
from winding_ros.topic import Topic

# Messages may be lost at the very end of a run: nothing more comes after so long.
_LAST_MESSAGES = 1.0
# Stamps are whole nanoseconds.
_ROUNDING = 1e-6
_PROCESSED = (topics.JOINT_STATES, topics.FEM_MARKERS, topics.CORRECTED_MARKERS)
_TRACKED = (topics.CAMERA_INFO, topics.TRACKED_MARKERS)
# Topics come each in a stream of its own: the last picture may arrive after what was made of it.
_PUBLISHED = tuple(topic for topic in (*RIG.publishes, *FEM.publishes) if topic.rate)


class Completion:
    """Tells when each node has processed a run's last sample.

    Args:
        end: Stamp of the run's end [s].
        camera: Whether frames are tracked.
    """

    def __init__(self, end: float, *, camera: bool = True) -> None:
        self._end = end
        self._camera = camera
        self._last: list[float] | None = None
        self._since = math.inf

    def reached(self, buffer: RunBuffer, now: float) -> bool:
        """Return whether the buffer has everything, as far as wall time `now` [s] shows."""
        if not all(self._ends(topic, buffer) for topic in _PROCESSED):
            return False
        heard = [topic for topic in _PUBLISHED if buffer.last_stamp(topic) >= 0.0]
        awaited = (*heard, *(_TRACKED if self._camera else ()))
        late = [topic for topic in awaited if not self._ends(topic, buffer)]
        if not late:
            return True
        # Frames may be tracked for long; what else is still to come is under way.
        last = [buffer.last_stamp(topic) for topic in late if topic in _TRACKED]
        if last != self._last:
            self._last, self._since = last, now
        return now - self._since >= _LAST_MESSAGES

    def _ends(self, topic: Topic, buffer: RunBuffer) -> bool:
        assert topic.rate is not None
        return buffer.last_stamp(topic) > self._end - 1.0 / topic.rate + _ROUNDING
