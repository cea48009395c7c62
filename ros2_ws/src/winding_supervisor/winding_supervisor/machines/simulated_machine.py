"""The simulated machine as its topics show it: time, phase, and whether its axes stand."""

from std_srvs.srv import Trigger

from winding_core.machine.incoming_readings import stands
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import services, topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.client.lifecycle import START_TIMEOUT
from winding_ros.graph import GraphError
from winding_ros.messages.rig import decode_joint_state
from winding_ros.messages.serialised import MessageError, deserialised
from winding_supervisor.machines.machine import Machine

_MOVING = ("winding", "stopping")
_STOP_TIMEOUT = 2.0


_SENSORS = (topics.CLOCK, topics.JOINT_STATES, topics.TENSION, topics.CAMERA_INFO)


class SimulatedMachine(Machine):
    """The rig node of this graph; its axes begin at zero, in radians and metres."""

    name = topics.RIG
    simulated = True

    def __init__(self, client: AsyncClient, buffer: RunBuffer, duration: float) -> None:
        super().__init__(client, buffer, *_SENSORS)
        self._planned, self._stopped = duration, False

    @property
    def end(self) -> float | None:
        """Stamp of the run's last sample [s]; of one that was stopped, once it is finished."""
        if not self._stopped:
            return self._planned
        status = self._client.status(topics.RIG)
        finished = status is not None and status.values.get("phase") == "finished"
        return float(status.values["time"]) if status is not None and finished else None

    @property
    def when(self) -> str:
        """The present time of the run in words."""
        return f"at {self.t:.3f} s of simulated time"

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
            _, reading = decode_joint_state(deserialised(message.data, topics.JOINT_STATES.type))
        except MessageError:
            return self._client.status(topics.RIG) is not None and not self.moving
        return stands(reading)

    def complaint(self) -> str:
        """Return why it has stopped by itself, to follow its name, or nothing."""
        status = self._client.status(topics.RIG)
        stopped = status is not None and status.values.get("reason")
        return f"is in {status.message}" if status is not None and stopped else ""

    async def start(self) -> None:
        """Start or resume.

        Raises:
            GraphError: It refused.
            TimeoutError: It does not answer.
        """
        response = await self._ask(services.START.name, START_TIMEOUT)
        if not response.success:
            raise GraphError(f"{services.START.name} was refused: {response.message}")

    async def quick_stop(self) -> str:
        """Ask it to come to rest; return how that failed, or nothing."""
        service, self._stopped = services.QUICK_STOP.name, True
        try:
            answer = await self._ask(service, _STOP_TIMEOUT)
        except TimeoutError:
            return f"{topics.RIG} did not answer to {service}"
        return "" if answer.success else f"{topics.RIG} refused {service} ({answer.message})"

    async def _ask(self, service: str, timeout: float) -> Trigger.Response:
        name = str(self._client.node.resolve_service_name(service))
        return await self._client.call(Trigger, name, Trigger.Request(), timeout)

    @property
    def _phase(self) -> str | None:
        status = self._client.status(topics.RIG)
        return None if status is None else status.values.get("phase")
