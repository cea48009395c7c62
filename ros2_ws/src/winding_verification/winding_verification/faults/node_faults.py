"""A node is killed or held."""

from __future__ import annotations

import os
import signal
import time
from functools import partial

from winding_ros.graph import GRAPH, Policy
from winding_supervisor.watch.event_log import Event
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.outcome import (
    CRASH_WITHIN,
    HANG_WITHIN,
    Outcome,
)

# Beyond these a run does not come back, unless so many restarts take longer than a minute.
_KILLS = 8
_WORDS = {signal.SIGKILL: ("kill -9", CRASH_WITHIN), signal.SIGSTOP: ("SIGSTOP", HANG_WITHIN)}


async def lose_node(cell: FaultCell, name: str, number: signal.Signals) -> Outcome:
    """Kill or hold a node; it has to be noticed, the machine to stand, the policy to be kept."""
    await cell.winding()
    spec = next(spec for spec in GRAPH if spec.name == name)
    words, bar = _WORDS[number]
    t = cell.t
    injected = time.monotonic()
    os.kill(cell.orchestrator.process(name).pid, number)
    detected = await cell.until(
        lambda: cell.log.find("detected", name, since=injected), "detection"
    )
    if spec.policy is Policy.END:
        sentence = await cell.end_of_run()
        ended = cell.log.find("ended", since=injected)
        assert ended is not None
        # Its drives go with its process.
        stood, outcome = ended.wall, f"the run ended: {sentence}"
        survived = name in sentence and cell.orchestrator.process(name).return_code is not None
    else:
        resumed = await _resumed(cell, injected)
        standing = cell.log.find("standing", since=injected)
        assert standing is not None
        stood = cell.stood(since=t) or standing.wall
        answer = spec.answer
        assert answer is not None
        await cell.until(
            lambda: cell.recorder.buffer.last_stamp(answer) > resumed.t + 0.3,
            f"new {answer.name} of the successor",
        )
        await cell.until(cell.at_full_speed, "full speed again")
        survived = cell.goes_on()
        outcome = f"{spec.policy.value}, after {resumed.wall - detected.wall:.1f} s"
        if spec.policy is Policy.REPLAY:
            outcome += f"; {resumed.t:.2f} s of inputs replayed"
    return Outcome(
        fault=f"{words} {name}",
        injected_at=t,
        detected_by="operating system" if number == signal.SIGKILL else "DDS liveliness",
        detected_after=detected.wall - injected,
        detect_within=bar,
        stood_after=max(0.0, stood - detected.wall),
        outcome=outcome,
        survived=survived,
    )


async def lose_successor(cell: FaultCell, name: str) -> Outcome:
    """Kill a node and hold its successor while it starts; another one has to take over."""
    await cell.winding()
    t = cell.t
    injected = time.monotonic()
    lost = cell.orchestrator.process(name).pid
    os.kill(lost, signal.SIGKILL)
    successor = await cell.until(lambda: _successor(cell, name, lost), "a successor")
    os.kill(successor, signal.SIGSTOP)
    given_up = await cell.until(
        lambda: next(
            (
                event
                for event in cell.log.events
                if event.wall >= injected and event.text.startswith("was not active again")
            ),
            None,
        ),
        "the successor is given up",
    )
    await _resumed(cell, injected)
    await cell.until(cell.at_full_speed, "full speed again")
    return Outcome(
        fault=f"kill -9 {name}, its successor hangs",
        injected_at=t,
        outcome=f"the successor {given_up.text}; another one resumes the run",
        survived=cell.goes_on() and cell.orchestrator.process(name).pid not in (lost, successor),
    )


async def lose_again_and_again(cell: FaultCell, name: str) -> Outcome:
    """Kill a node whenever it is there again; the run has to end rather than go on like that."""
    await cell.winding()
    t, kills = cell.t, 0
    while cell.goes_on() and kills < _KILLS:
        killed = time.monotonic()
        os.kill(cell.orchestrator.process(name).pid, signal.SIGKILL)
        kills += 1
        await cell.until(partial(_resumed_or_over, cell, killed), "the run resumes or ends")
    sentence = await cell.end_of_run()
    return Outcome(
        fault=f"kill -9 {name} again and again",
        injected_at=t,
        outcome=f"the run ended: {sentence}",
        # Kills of the rows before may count too.
        survived=name in sentence and "for the fourth time within a minute" in sentence,
    )


async def _resumed(cell: FaultCell, since: float) -> Event:
    found: Event = await cell.until(
        lambda: cell.log.find("resumed", since=since), "the run resumes"
    )
    return found


def _resumed_or_over(cell: FaultCell, since: float) -> bool:
    return cell.log.find("resumed", since=since) is not None or not cell.goes_on()


def _successor(cell: FaultCell, name: str, lost: int) -> int | None:
    process = cell.orchestrator.process(name)
    return process.pid if process.started and process.pid != lost else None
