"""Somebody else on the network, or somebody who asks for what cannot be."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from winding_ros import topics
from winding_ros.environment import child_environment
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.outcome import NOTICE_WITHIN, Outcome

_PATIENCE = 60.0
# A topic is looked at ten times a second, after discovery.
_STRANGER_WITHIN = NOTICE_WITHIN


@asynccontextmanager
async def _stranger(cell: FaultCell, role: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """A node of nobody's in a process of its own; its first line says that it is there."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        str(Path(__file__).with_name("stranger.py")),
        role,
        cell.namespace,
        env=child_environment(),
        stdout=asyncio.subprocess.PIPE,
        stdin=asyncio.subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.wait()


async def _said(process: asyncio.subprocess.Process) -> str:
    assert process.stdout is not None
    line = await asyncio.wait_for(process.stdout.readline(), _PATIENCE)
    return line.decode().strip()


async def rogue_publisher(cell: FaultCell) -> Outcome:
    """A second publisher on a sensor topic; the machine has to stop and to name it."""
    await cell.winding()
    t = cell.t
    async with _stranger(cell, "rogue") as process:
        # It says when its publisher was made: discovery counts.
        injected = float(await _said(process))
        sentence = await cell.end_of_run()
        await cell.until(lambda: cell.stood(since=t), "standstill")
        began, stood = cell.stop_began(since=t), cell.stood(since=t)
    assert began is not None
    assert stood is not None
    return Outcome(
        fault="rogue publisher on rig/tension",
        injected_at=t,
        detected_by="winding_rig and readers",
        detected_after=max(0.0, began - injected),
        detect_within=_STRANGER_WITHIN,
        stood_after=stood - began,
        outcome=f"the run ended: {sentence}",
        survived="rig/tension has 2 publishers" in sentence and "rogue" in sentence,
    )


async def quality_mismatch(cell: FaultCell) -> Outcome:
    """A subscriber asks for what no publisher offers; an error says so, and the run goes on."""
    await cell.winding()
    t = cell.t
    async with _stranger(cell, "mismatch") as process:
        injected = float(await _said(process))
        name = f"{topics.RIG}: quality of service"
        await cell.until(lambda: cell.client.status(name), "an error in /diagnostics")
        seen = time.monotonic()
        status = cell.client.status(name)
    assert status is not None
    await cell.until(lambda: cell.t > t + 0.5, "the run goes on")
    return Outcome(
        fault="QoS mismatch",
        injected_at=t,
        detected_by="DDS incompatible_qos",
        detected_after=max(0.0, seen - injected),
        detect_within=_STRANGER_WITHIN,
        outcome=f"ERROR in /diagnostics: {status.message}; the run went on",
        survived=cell.goes_on() and "DURABILITY" in status.message,
    )


async def late_joiner(cell: FaultCell) -> Outcome:
    """A reader comes in the middle; it gets what is latched and what is live."""
    await cell.winding()
    t = cell.t
    async with _stranger(cell, "late") as process:
        said = await _said(process)
    await cell.until(lambda: cell.t > t + 0.5, "the run goes on")
    return Outcome(
        fault="late joiner",
        injected_at=t,
        outcome=said,
        survived=said == "got the prediction and 100 encoder samples in a row" and cell.goes_on(),
    )


async def wrong_parameters(cell: FaultCell) -> Outcome:
    """Parameters out of range, of a wrong type, unknown or fixed; each refused by a sentence."""
    await cell.winding()
    t = cell.t
    answers = {
        "range": await cell.inject("camera:intermittent:1.5"),
        "type": await cell.set_parameter(topics.RIG, "inject_fault", 1.0),
        "unknown": await cell.set_parameter(topics.RIG, "inject_fautl", "camera:off"),
        "fixed": await cell.set_parameter(topics.RIG, "speed", 2.0),
        "unknown target": await cell.inject("camrea:off"),
    }
    await cell.until(lambda: cell.t > t + 0.5, "the run goes on")
    accepted = [name for name, reason in answers.items() if not reason]
    return Outcome(
        fault="wrong parameters",
        injected_at=t,
        detected_by="node",
        outcome="; ".join(answers.values()) + "; the run went on",
        survived=not accepted and cell.goes_on(),
    )
