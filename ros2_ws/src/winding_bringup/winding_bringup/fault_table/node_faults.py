"""A node is killed or held."""

from __future__ import annotations

import os
import signal
import time

from winding_bringup.fault_table.cell import FaultCell
from winding_bringup.fault_table.outcome import (
    CRASH_WITHIN,
    HANG_WITHIN,
    Outcome,
    machine_load,
)
from winding_bringup.graph import GRAPH, Policy

_WORDS = {signal.SIGKILL: ("kill -9", CRASH_WITHIN), signal.SIGSTOP: ("SIGSTOP", HANG_WITHIN)}


async def lose_node(cell: FaultCell, name: str, number: signal.Signals) -> Outcome:
    """Kill or hold a node; it has to be noticed, the machine to stand, the policy to be kept."""
    await cell.winding()
    spec = next(spec for spec in GRAPH if spec.name == name)
    words, bar = _WORDS[number]
    t = cell.t
    injected = time.monotonic()
    os.kill(cell.orchestrator.process(name).pid, number)
    await cell.until(lambda: cell.log.find("detected", name, since=injected), "detection")
    detected = cell.log.find("detected", name, since=injected)
    assert detected is not None
    if spec.policy is Policy.END:
        sentence = await cell.end_of_run()
        ended = cell.log.find("ended", since=injected)
        assert ended is not None
        # Its drives go with its process.
        stood, outcome = ended.wall, f"the run ended: {sentence}"
        survived = name in sentence and cell.orchestrator.process(name).return_code is not None
    else:
        await cell.until(lambda: cell.log.find("resumed", since=injected), "the run resumes")
        standing = cell.log.find("standing", since=injected)
        resumed = cell.log.find("resumed", since=injected)
        assert standing is not None
        assert resumed is not None
        stood = cell.stood(since=t) or standing.wall
        answer = spec.answer
        assert answer is not None
        await cell.until(
            lambda: cell.recorder.tape.last_stamp(answer) > resumed.t + 0.3,
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
        load=machine_load(),
    )
