"""The orchestrator itself is killed or held; and two graphs share a machine."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import psutil  # type: ignore[import-untyped]
from rclpy.serialization import deserialize_message

from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.messages.rig import decode_joint_state
from winding_verification.faults.cell import CASE, CellError, FaultCell
from winding_verification.faults.outcome import Outcome

# The dead-man waits 1.5 s; nodes of a killed orchestrator are told at once.
_DEADMAN_WITHIN = 1.7
_GONE_WITHIN = 1.0
_PATIENCE = 120.0
_POLL = 0.01
# As a reader sees it: the estimate of a standing encoder still decays for some milliseconds.
_STANDING = 0.02


class Observer:
    """Sees a graph of another process from outside."""

    def __init__(self, namespace: str) -> None:
        self.client = AsyncClient(namespace)
        self.speed = 0.0
        self.t = -1.0
        self.still_since: float | None = None
        topics.JOINT_STATES.subscribe(self.client.node, self._note, raw=True)
        self.client.start()

    def _note(self, data: bytes) -> None:
        self.t, reading = decode_joint_state(deserialize_message(data, topics.JOINT_STATES.type))
        self.speed = reading.angular_speed
        if abs(self.speed) > _STANDING:
            self.still_since = None
        elif self.still_since is None:
            self.still_since = time.monotonic()


@asynccontextmanager
async def _run_of_its_own(
    directory: Path, namespace: str, *options: str
) -> AsyncIterator[asyncio.subprocess.Process]:
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", "winding_cli.cli", "run", "--case", str(CASE), "--namespace", namespace),
        *("--domain", os.environ["ROS_DOMAIN_ID"], "--output", str(directory), *options),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            # A held process would not hear anything else.
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGKILL)
        await process.wait()


async def _until(reached: Callable[[], bool], what: str, patience: float = _PATIENCE) -> float:
    end = time.monotonic() + patience
    while not reached():
        if time.monotonic() > end:
            raise CellError(f"not within {patience:g} s: {what}")
        await asyncio.sleep(_POLL)
    return time.monotonic()


async def lose_orchestrator(directory: Path, number: signal.Signals) -> Outcome:
    """Kill or hold the orchestrator of a run; the machine has to stand, killed ones' nodes to end.

    Args:
        directory: New folder of the run.
        number: SIGKILL or SIGSTOP.
    """
    namespace = f"orphan{int(number)}"
    observer = Observer(namespace)
    try:
        async with _run_of_its_own(directory, namespace) as run:
            await _until(lambda: observer.speed > 1.65, "a machine that winds at full speed")
            nodes = psutil.Process(run.pid).children()
            t, injected = observer.t, time.monotonic()
            run.send_signal(number)
            still = await _until(lambda: observer.still_since is not None, "standstill")
            still = observer.still_since or still
            killed = number == signal.SIGKILL
            if killed:
                gone = await _until(lambda: not any(map(_lives, nodes)), "end of the nodes")
                outcome = f"{len(nodes)} nodes ended {gone - injected:.2f} s after the orchestrator"
                survived = len(nodes) == 4
                detected_after, bar = gone - injected, _GONE_WITHIN
            else:
                reason = await _reason(observer)
                run.send_signal(signal.SIGCONT)
                _, said = await asyncio.wait_for(run.communicate(), _PATIENCE)
                sentence = said.decode().strip().splitlines()[-1]
                outcome = f"{reason}; let go, it said: {sentence}"
                survived = "sign of life" in sentence and run.returncode == 1
                # The stop itself takes 0.3 s.
                detected_after, bar = max(0.0, still - injected - 0.3), _DEADMAN_WITHIN
    finally:
        observer.client.close()
    return Outcome(
        fault=f"{'kill -9' if killed else 'SIGSTOP'} orchestrator",
        injected_at=t,
        detected_by="kernel (parent-death signal)" if killed else "winding_rig (dead-man)",
        detected_after=detected_after,
        detect_within=bar,
        stood_after=still - injected if killed else None,
        outcome=outcome,
        survived=survived,
    )


def _lives(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


async def _reason(observer: Observer) -> str:
    def told() -> str:
        status = observer.client.status(topics.RIG)
        return status.values.get("reason", "") if status is not None else ""

    await _until(lambda: bool(told()), "the machine's reason")
    return told()


async def second_graph(cell: FaultCell, directory: Path) -> Outcome:
    """Run another graph beside this one: refused in the same namespace, welcome in another."""
    await cell.winding()
    t = cell.t
    async with _run_of_its_own(directory / "same", cell.namespace) as refused:
        _, said = await asyncio.wait_for(refused.communicate(), _PATIENCE)
    async with _run_of_its_own(directory / "other", "second", "--duration-s", "1") as welcome:
        await asyncio.wait_for(welcome.communicate(), _PATIENCE)
    return Outcome(
        fault="two rigs on one machine",
        injected_at=t,
        detected_by="lock of domain and namespace",
        outcome=f"same namespace: {said.decode().strip()}; another namespace: exit code "
        f"{welcome.returncode}; the first run went on",
        survived=refused.returncode == 2 and welcome.returncode == 0 and cell.goes_on(),
    )
