"""The pull that a run commands along the cylinder's angle, where the machine has a brake."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress

import numpy as np

from winding_core.machine.commands import TensionCommand
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import GraphError
from winding_ros.messages.commands import encode_tension_command

# Corners of a programme: cylinder angle [rad] and pull [N].
Corner = tuple[float, float]
_PERIOD = 0.04
# A machine takes commands once it winds.
_WINDING = 1.0e-3
# A driver's subscription is discovered within so long [s].
_DISCOVERY = 10.0


class PullProgramme:
    """Publishes rig/tension_command as the cylinder turns.

    Args:
        client: Its node publishes.
        buffer: Has the newest encoder samples.
        corners: At ascending angles, straight lines between; at least one.
    """

    def __init__(self, client: AsyncClient, buffer: RunBuffer, corners: Sequence[Corner]) -> None:
        self._buffer = buffer
        self._angles, self._pulls = (list(column) for column in zip(*corners, strict=True))
        self._publisher = topics.TENSION_COMMAND.advertise(client.node)

    async def taken(self) -> None:
        """Wait until the machine listens.

        Raises:
            GraphError: It does not.
        """
        waited = 0.0
        while not self._publisher.get_subscription_count():
            if waited >= _DISCOVERY:
                raise GraphError("the machine does not take rig/tension_command: it has no brake")
            await asyncio.sleep(_PERIOD)
            waited += _PERIOD

    @asynccontextmanager
    async def followed(self) -> AsyncIterator[None]:
        """Command the pull while the body runs."""
        task = asyncio.create_task(self._follow())
        try:
            yield
        finally:
            task.cancel()
            # What ended it before is an error of the run.
            with suppress(asyncio.CancelledError):
                await task

    async def _follow(self) -> None:
        while True:
            newest = self._buffer.newest_axis_reading()
            if newest is not None and newest[1].cylinder_angle > _WINDING:
                pull = float(np.interp(newest[1].cylinder_angle, self._angles, self._pulls))
                self._publisher.publish(encode_tension_command(TensionCommand(t=0.0, force=pull)))
            await asyncio.sleep(_PERIOD)
