"""A supervised graph of real processes that winds one run after the other."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from winding_core.status import Status
from winding_recorder.live.recorder import Recorder
from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.graph import GRAPH, GraphError, pace_topics
from winding_ros.messages.rig import decode_joint_state
from winding_ros.messages.serialised import MessageError
from winding_supervisor.machines.simulated_machine import SimulatedMachine
from winding_supervisor.processes.orchestrator import GraphConfig, Orchestrator
from winding_supervisor.watch.event_log import EventLog
from winding_supervisor.watch.supervisor import Supervisor, replay_parameters

CASE = 4
# A new run begins when the present one has gone on for so long [s].
_RUN_LENGTH = 30.0
_LONG_ENOUGH = 20.0
_PATIENCE = 60.0
_POLL = 0.01
_FULL_SPEED = 1.74 * 0.95
_PICTURES = (topics.IMAGE, topics.PREVIEW)


class CellError(RuntimeError):
    """The graph did not reach a state in which a fault can be put in."""


async def until(reached: Callable[[], Any], what: str, patience: float = _PATIENCE) -> Any:
    """Wait until a predicate is true; return its value.

    Args:
        reached: Predicate.
        what: It is waited for, for the error.
        patience: Greatest wait [s].

    Raises:
        CellError: It does not become true in time.
    """
    end = time.monotonic() + patience
    while not (value := reached()):
        if time.monotonic() > end:
            raise CellError(f"not within {patience:g} s: {what}")
        await asyncio.sleep(_POLL)
    return value


class Cell:
    """The graph that winds on.

    Args:
        directory: New folder of logs and events.
        namespace: Of the graph.
    """

    def __init__(self, directory: Path, namespace: str) -> None:
        (directory / "log").mkdir(parents=True)
        self.namespace = namespace
        self.directory = directory
        self.log = EventLog(file=directory / "events.jsonl")
        self.client = AsyncClient(namespace)
        recorded = tuple(
            topic for topic in topics.TOPICS if topic.recorded and topic not in _PICTURES
        )
        self.recorder = Recorder(self.client.node, None, recorded=recorded)
        parameters: dict[str, dict[str, object]] = {
            spec.name: {"case": CASE, "duration": _RUN_LENGTH} for spec in GRAPH
        }
        # The buffer's answers never go back in time, and here the rig is started anew.
        paced = [topic.name for topic in pace_topics() if topic is not topics.RECORDER_PROGRESS]
        parameters[topics.RIG] |= {"pace_topics": ",".join(paced)}
        parameters[topics.FEM] |= {"update_material": True}
        self.orchestrator = Orchestrator(
            GraphConfig(
                namespace=namespace,
                log_directory=directory / "log",
                parameters=parameters,
                recorded=frozenset(topic.name for topic in recorded),
            ),
            self.client,
        )
        self.supervisor = Supervisor(
            self.orchestrator,
            SimulatedMachine(self.client, self.recorder.buffer, _RUN_LENGTH),
            self.client,
            self.recorder.buffer,
            self.log,
            {name: partial(self._replay, name) for name in (topics.FEM, topics.TRACKER)},
        )
        self.supervision: asyncio.Task[None] | None = None
        self._began = self._begun = 0.0

    def _replay(self, name: str) -> dict[str, object]:
        file = self.directory / "log" / f"{name}_inputs.npy"
        return replay_parameters(self.recorder.buffer, file, self._begun)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[Cell]:
        """Bring the graph up; stop it at the end."""
        self.client.start()
        try:
            await self.orchestrator.start()
            await self.orchestrator.bring_up()
            async with self.supervisor.beating():
                yield self
        finally:
            try:
                await self._unsupervised()
                await self.orchestrator.stop()
            finally:
                self.recorder.close()
                self.client.close()

    @property
    def t(self) -> float:
        """Simulated time of the newest encoder sample [s]."""
        return self.recorder.buffer.last_stamp(topics.JOINT_STATES)

    @property
    def rig(self) -> Status:
        """Diagnostics of the machine."""
        return self.client.status(topics.RIG) or Status(name=topics.RIG)

    async def until(self, reached: Callable[[], Any], what: str) -> Any:
        """Wait until a predicate is true; return its value.

        Raises:
            CellError: It does not become true in time, or supervision itself fails.
        """

        def supervised() -> Any:
            value = reached()
            if not value and self.supervision is not None and self.supervision.done():
                error = self.supervision.exception()
                if error is not None and not isinstance(error, GraphError):
                    raise CellError(f"supervision failed: {error!r}") from error
            return value

        return await until(supervised, what)

    async def winding(self) -> float:
        """Make the machine wind at full speed, healthy and supervised; return `t` then [s]."""
        over = not self.goes_on() or self.t - self._began > _LONG_ENOUGH
        if over or self.rig.values.get("phase") != "winding":
            await self._again()
        await self.until(self.at_full_speed, "full speed")
        return self.t

    async def end_of_run(self) -> str:
        """Wait until supervision ends the run; return the sentence that gives the cause.

        Raises:
            CellError: The run goes on, or supervision itself failed.
        """
        assert self.supervision is not None
        done, _ = await asyncio.wait({self.supervision}, timeout=_PATIENCE)
        if not done:
            raise CellError(f"the run goes on for {_PATIENCE:g} s after the fault")
        error = self.supervision.exception()
        if not isinstance(error, GraphError):
            raise CellError(f"supervision failed: {error!r}") from error
        return str(error)

    def at_full_speed(self) -> bool:
        """Return whether the cylinder has its speed, as its encoder sees it."""
        return self.speed > _FULL_SPEED

    def goes_on(self) -> bool:
        """Return whether the run has not been ended."""
        return self.supervision is not None and not self.supervision.done()

    @property
    def speed(self) -> float:
        """Measured speed of the cylinder [rad/s]."""
        message = self.recorder.buffer.last(topics.JOINT_STATES)
        if message is None:
            return 0.0
        try:
            _, reading = decode_joint_state(
                deserialize_message(message.data, topics.JOINT_STATES.type)
            )
        except MessageError:
            # The newest message may be the fault itself.
            return 0.0
        return reading.angular_speed

    async def _unsupervised(self) -> None:
        if self.supervision is not None:
            self.supervision.cancel()
            with contextlib.suppress(asyncio.CancelledError, GraphError):
                await self.supervision
            self.supervision = None

    async def _again(self) -> None:
        """Clear every fault and begin a new run."""
        await self._unsupervised()
        dead = [
            spec.name
            for spec in GRAPH
            if self.orchestrator.process(spec.name).return_code is not None
        ]
        for name in dead:
            late = partial(self.log.note, "restarting", name, t=self.t)
            await self.orchestrator.restart(name, {}, late)
        if dead:
            await self.orchestrator.rematch(dead)
        if topics.RIG not in dead:
            await self._command("rig/quick_stop")
            await self.until(
                lambda: self.rig.values.get("phase") not in ("winding", "stopping"),
                "standstill before a reset",
            )
            await self._reset()
        await self.orchestrator.begin_anew()
        await self.until(
            lambda: self.rig.values.get("phase") == "idle" and not self.rig.values.get("reason"),
            "an idle machine",
        )
        await self.until(self._topics_are_healthy, "healthy topics")
        self._began, self._begun = max(self.t, 0.0), time.monotonic()
        self.supervision = asyncio.create_task(self.supervisor.watch())
        await self._command("rig/start")

    async def _command(self, service: str) -> None:
        answer = await self.client.call(
            Trigger, f"/{self.namespace}/{service}", Trigger.Request(), _PATIENCE
        )
        if not answer.success:
            raise GraphError(f"{service} was refused: {answer.message}")

    async def _reset(self) -> None:
        end = time.monotonic() + _PATIENCE
        while True:
            try:
                await self._command("rig/reset")
            except GraphError:
                # It reports idle a moment before the brakes hold.
                if time.monotonic() > end:
                    raise
                await asyncio.sleep(_POLL)
            else:
                return

    def _topics_are_healthy(self) -> bool:
        return all(
            (status := self.client.status(f"{spec.name}: topics")) is not None and status.level < 2
            for spec in GRAPH
        )
