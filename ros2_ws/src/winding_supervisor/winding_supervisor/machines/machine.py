"""What a run asks of its machine, whoever drives it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from winding_core.run_outcome import Cause, Motion
from winding_ros.topic import Topic


class Machine(Protocol):
    """A winding machine as run and supervision see it.

    Attributes:
        name: What its complaints are about.
        sensors: Topics that keep step with each other while the machine winds.
        simulated: Whether its driver is a node of this graph, which can be ended with its drives.
    """

    name: str
    sensors: tuple[Topic, ...]
    simulated: bool

    @property
    def t(self) -> float:
        """Time of the newest encoder sample [s]."""

    @property
    def when(self) -> str:
        """The present time of the run in words."""

    @property
    def end(self) -> float | None:
        """Stamp of the run's last sample [s]; None while it is not known."""

    @property
    def moving(self) -> bool:
        """Whether its axes move, or are about to."""

    @property
    def built(self) -> bool:
        """Whether there is a machine at all."""

    @property
    def standing(self) -> bool:
        """Whether both axes stand."""

    @property
    def motion(self) -> Motion:
        """What is known of its axes now; a machine that has fallen silent is not known to stand."""

    @property
    def early(self) -> Cause | None:
        """Why its end is not the one that was asked for; None where it is, or is not reached."""

    def remark(self) -> str:
        """Return what an operator should know of it although the run goes on, or nothing."""

    def parameters(self) -> Mapping[str, object]:
        """Return what the nodes have to know of its axes."""

    def complaint(self) -> str:
        """Return why the run cannot go on with this machine, to follow its name, or nothing."""

    async def stand(self) -> None:
        """Wait until the machine is there and stands, before any node is started.

        Raises:
            GraphError: It is not there, or moves.
        """

    async def ready(self) -> None:
        """Refuse a machine that is not as it was when the nodes were started.

        Raises:
            GraphError: It has moved, or a sensor is silent.
        """

    async def start(self) -> None:
        """Start or resume.

        Raises:
            GraphError: It refused, or cannot be asked.
        """

    async def begun(self) -> None:
        """Wait until the run has begun.

        Raises:
            GraphError: The machine does not begin.
        """

    async def leave(self) -> str | None:
        """Leave the machine at rest when the run ends.

        Returns:
            How a stop failed, empty for one that was delivered; None where none was needed.
        """

    async def quick_stop(self) -> str:
        """Ask it to come to rest; return how that failed, or nothing."""
