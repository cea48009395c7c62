"""What a run asks of its machine, whoever drives it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

from winding_core.run_outcome import Cause, Motion
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.topic import Topic


class Machine(ABC):
    """A winding machine as run and supervision see it.

    What is answered here is so of one whose driver is a node of this graph: it is started with the
    others and stands, its drives end with its process, its time with its run.

    Args:
        client: Has the newest diagnostics; calls its services.
        buffer: Has the newest encoder samples.
        sensors: Topics that keep step with each other while the machine winds.
    """

    name: str  # What its complaints are about
    # Whether its driver is a node of this graph, which can be ended with its drives.
    simulated: bool

    def __init__(self, client: AsyncClient, buffer: RunBuffer, *sensors: Topic) -> None:
        self._client, self._buffer, self.sensors = client, buffer, sensors
        self._end: float | None = None

    @property
    def end(self) -> float | None:
        """Stamp of the run's last sample [s]; None while it is not known."""
        return self._end

    @property
    def t(self) -> float:
        """Time of the newest encoder sample [s]."""
        return max(self._buffer.last_stamp(topics.JOINT_STATES), 0.0)

    @property
    @abstractmethod
    def when(self) -> str:
        """The present time of the run in words."""

    @property
    @abstractmethod
    def moving(self) -> bool:
        """Whether its axes move, or are about to."""

    @property
    @abstractmethod
    def built(self) -> bool:
        """Whether there is a machine at all."""

    @property
    @abstractmethod
    def standing(self) -> bool:
        """Whether both axes stand."""

    @property
    def motion(self) -> Motion:
        """What is known of its axes now; a machine that has fallen silent is not known to stand."""
        return Motion.STANDING

    @property
    def early(self) -> Cause | None:
        """Why its end is not the one that was asked for; None where it is, or is not reached."""
        return None

    def remark(self) -> str:
        """Return what an operator should know of it although the run goes on, or nothing."""
        return ""

    def parameters(self) -> Mapping[str, object]:
        """Return what the nodes have to know of its axes; nothing where they begin at zero."""
        return {}

    @abstractmethod
    def complaint(self) -> str:
        """Return why the run cannot go on with this machine, to follow its name, or nothing."""

    async def stand(self) -> None:  # noqa: B027
        """Wait until the machine is there and stands, before any node is started.

        Raises:
            GraphError: It is not there, or moves.
        """

    async def ready(self) -> None:  # noqa: B027
        """Refuse a machine that is not as it was when the nodes were started.

        Raises:
            GraphError: It has moved, or a sensor is silent.
        """

    @abstractmethod
    async def start(self) -> None:
        """Start or resume.

        Raises:
            GraphError: It refused, or cannot be asked.
        """

    async def begun(self) -> None:  # noqa: B027
        """Wait until the run has begun.

        Raises:
            GraphError: The machine does not begin.
        """

    async def leave(self) -> str | None:
        """Leave the machine at rest when the run ends.

        Returns:
            How a stop failed, empty for one that was delivered; None where none was needed.
        """
        return None

    @abstractmethod
    async def quick_stop(self) -> str:
        """Ask it to come to rest; return how that failed, or nothing."""
