"""The machine as its topics show it: time, phase, and whether its axes stand."""

from __future__ import annotations

from rclpy.serialization import deserialize_message

from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.async_client import AsyncClient
from winding_ros.rig_messages import MessageError, decode_joint_state

# Slower than this an axis stands, as its encoder sees it [rad/s, m/s].
_STANDING = (0.02, 6.0e-5)
_MOVING = ("winding", "stopping")


class MachineState:
    """The machine as the supervisor sees it.

    Args:
        client: Has the newest diagnostics.
        buffer: Has the newest encoder samples.
    """

    def __init__(self, client: AsyncClient, buffer: RunBuffer) -> None:
        self._client = client
        self._buffer = buffer

    @property
    def t(self) -> float:
        """Simulated time of the newest encoder sample [s]."""
        return max(self._buffer.last_stamp(topics.JOINT_STATES), 0.0)

    @property
    def moving(self) -> bool:
        """Whether its phase is one in which the axes move."""
        return self._phase in _MOVING

    @property
    def built(self) -> bool:
        """Whether there is a machine at all; an unconfigured rig has none."""
        return self._phase is not None

    @property
    def standing(self) -> bool:
        """Whether both axes stand, by their encoders or, failing these, by the machine's phase."""
        message = self._buffer.last(topics.JOINT_STATES)
        if message is None:
            return True
        try:
            _, reading = decode_joint_state(
                deserialize_message(message.data, topics.JOINT_STATES.type)
            )
        except MessageError:
            return self._client.status(topics.RIG) is not None and not self.moving
        return abs(reading.angular_speed) < _STANDING[0] and abs(reading.feed_speed) < _STANDING[1]

    @property
    def _phase(self) -> str | None:
        status = self._client.status(topics.RIG)
        return None if status is None else status.values.get("phase")
