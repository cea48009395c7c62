"""Faults from other processes: external nodes, a second graph, the loss of an orchestrator."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import psutil  # type: ignore[import-untyped]
from rclpy.serialization import deserialize_message

from winding_ros import topics
from winding_ros.client.async_client import AsyncClient
from winding_ros.environment import child_environment
from winding_ros.messages.rig import decode_joint_state
from winding_verification.faults import external_node
from winding_verification.faults.cell import CASE, FaultCell, until
from winding_verification.faults.outcome import NOTICE_WITHIN, Outcome

# The dead-man waits 1.5 s and the stop takes 0.3 s; the kernel ends nodes of a killed orchestrator.
_DEADMAN_WITHIN = 1.7
_STOP_TAKES = 0.3
_GONE_WITHIN = 1.0
_PATIENCE = 120.0
# The estimated speed of a standing encoder still decays for some milliseconds [rad/s].
_STANDING = 0.02
_Process = contextlib.AbstractAsyncContextManager[asyncio.subprocess.Process]


async def rogue_publisher(cell: FaultCell) -> Outcome:
    """A second publisher on a sensor topic; the machine has to stop and to name it."""
    t = await cell.winding()
    async with _external(cell, "rogue") as process:
        # When its publisher was made: discovery counts.
        injected = float(await _first_line(process))
        sentence = await cell.end_of_run()
        began, stood = await cell.stop(since=t)
    return Outcome(
        fault="rogue publisher on rig/tension",
        injected_at=t,
        detected_by="winding_rig and readers",
        detected_after=max(0.0, began - injected),
        detect_within=NOTICE_WITHIN,
        stood_after=stood - began,
        outcome=f"the run ended: {sentence}",
        survived="rig/tension has 2 publishers" in sentence and "rogue" in sentence,
    )


async def quality_mismatch(cell: FaultCell) -> Outcome:
    """A subscriber requests a QoS that no publisher offers: reported as an error, not fatal."""
    t = await cell.winding()
    name = f"{topics.RIG}: quality of service"
    async with _external(cell, "mismatch") as process:
        injected = float(await _first_line(process))
        status = await cell.until(lambda: cell.client.status(name), "an error in /diagnostics")
        seen = time.monotonic()
    return Outcome(
        fault="QoS mismatch",
        injected_at=t,
        detected_by="DDS incompatible_qos",
        detected_after=max(0.0, seen - injected),
        detect_within=NOTICE_WITHIN,
        outcome=f"ERROR in /diagnostics: {status.message}; the run went on",
        survived=await cell.went_on(t) and "DURABILITY" in status.message,
    )


async def late_joiner(cell: FaultCell) -> Outcome:
    """A reader that starts in mid-run; it receives what is latched and what is live."""
    t = await cell.winding()
    async with _external(cell, "late") as process:
        report = await _first_line(process)
    expected = "got the prediction and 100 encoder samples in a row"
    survived = await cell.went_on(t) and report == expected
    return Outcome(fault="late joiner", injected_at=t, outcome=report, survived=survived)


async def second_graph(cell: FaultCell) -> Outcome:
    """Run another graph beside this one: refused in the same namespace, accepted in another."""
    t = await cell.winding()
    folder = cell.directory / "second_graph"
    async with _run(folder / "same", cell.namespace) as refused:
        _, reason = await asyncio.wait_for(refused.communicate(), _PATIENCE)
    async with _run(folder / "other", "second", "--duration-s", "1") as accepted:
        await asyncio.wait_for(accepted.communicate(), _PATIENCE)
    return Outcome(
        fault="two rigs on one machine",
        injected_at=t,
        detected_by="lock of domain and namespace",
        outcome=f"same namespace: {reason.decode().strip()}; another namespace: exit code "
        f"{accepted.returncode}; the first run went on",
        survived=refused.returncode == 2 and accepted.returncode == 0 and cell.goes_on(),
    )


class Observer:
    """Reads the joint states of a graph of another process."""

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

    def reason(self) -> str:
        """Return why the machine stopped, as its diagnostics report it; empty if they do not."""
        status = self.client.status(topics.RIG)
        return status.values.get("reason", "") if status is not None else ""


async def lose_orchestrator(directory: Path, number: signal.Signals) -> Outcome:
    """Kill or hold the orchestrator of a run; the machine has to stand, killed ones' nodes to end.

    Args:
        directory: New folder of the run.
        number: SIGKILL or SIGSTOP.
    """
    namespace = f"orphan{int(number)}"
    observer = Observer(namespace)
    killed = number == signal.SIGKILL
    try:
        async with _run(directory, namespace) as run:
            await until(lambda: observer.speed > 1.65, "full speed", _PATIENCE)
            nodes = psutil.Process(run.pid).children()
            t, injected = observer.t, time.monotonic()
            run.send_signal(number)
            still = await until(lambda: observer.still_since, "standstill", _PATIENCE)
            if killed:
                await until(lambda: not any(map(_lives, nodes)), "end of the nodes", _PATIENCE)
                detected_after, bar = time.monotonic() - injected, _GONE_WITHIN
                outcome = f"{len(nodes)} nodes ended {detected_after:.2f} s after the orchestrator"
                survived = len(nodes) == 4
            else:
                reason = await until(observer.reason, "the machine's reason", _PATIENCE)
                run.send_signal(signal.SIGCONT)
                _, printed = await asyncio.wait_for(run.communicate(), _PATIENCE)
                sentence = printed.decode().strip().splitlines()[-1]
                outcome = f"{reason}; continued, it reported: {sentence}"
                survived = "sign of life" in sentence and run.returncode == 1
                detected_after, bar = max(0.0, still - injected - _STOP_TAKES), _DEADMAN_WITHIN
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


@asynccontextmanager
async def _python(
    module: str, *words: str, **options: Any
) -> AsyncIterator[asyncio.subprocess.Process]:
    """Run a module in a process of its own, without input; it is killed at the end."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", module, *words, stdin=asyncio.subprocess.DEVNULL, **options
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            # A held process takes no other signal.
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGKILL)
        await process.wait()


def _external(cell: FaultCell, role: str) -> _Process:
    return _python(
        external_node.__name__,
        role,
        cell.namespace,
        env=child_environment(),
        stdout=asyncio.subprocess.PIPE,
    )


def _run(directory: Path, namespace: str, *options: str) -> _Process:
    return _python(
        "winding_cli.cli",
        *("run", "--case", str(CASE), "--namespace", namespace),
        *("--domain", os.environ["ROS_DOMAIN_ID"], "--output", str(directory), *options),
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
    )


async def _first_line(process: asyncio.subprocess.Process) -> str:
    assert process.stdout is not None
    line = await asyncio.wait_for(process.stdout.readline(), _PATIENCE)
    return line.decode().strip()


def _lives(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False
