"""Faults of the cell's own parts: nodes killed or held, sensors that fail, wrong parameters."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from importlib.resources import files

from winding_core.run_outcome import Event
from winding_ros import topics
from winding_ros.graph import GRAPH, Policy
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.outcome import CRASH_WITHIN, HANG_WITHIN, Outcome

# Beyond these a run does not come back, unless so many restarts take longer than a minute.
_KILLS = 8
_WORDS = {signal.SIGKILL: ("kill -9", CRASH_WITHIN), signal.SIGSTOP: ("SIGSTOP", HANG_WITHIN)}
_LOSS = 0.2
# Who notices a topic that is silent or out of time; its time of detection is in the event log.
_STAMPS = "orchestrator (stamps)"


@dataclass(frozen=True, kw_only=True)
class SensorFault:
    """A fault of a sensor or topic that has to end in a standstill.

    Attributes:
        noticed: Phrase that the end of the run has to contain, and the part that notices then;
            the first of several that matches.
        within: Bar of the detection [s]: 0.4 for a stop of the machine's own, which begins after
            50 ms, or after 300 ms for a load cell that never changes; 1.2 for a reader's; 2.8 for
            a topic, which may be late for 2 s on a busy machine before it counts as silent.
    """

    name: str  # As the table calls it
    inject: str  # For the parameter `inject_fault`
    noticed: Mapping[str, str]
    within: float

    def noticed_by(self, sentences: str) -> str:
        """Return who noticed by what the graph reported; empty when no phrase matches."""
        return next((by for phrase, by in self.noticed.items() if phrase in sentences), "")


SENSOR_FAULTS = tuple(
    SensorFault(**row)
    for row in json.loads(
        files("winding_verification").joinpath("data", "sensor_faults.json").read_text("utf-8")
    )
)


async def lose_node(cell: FaultCell, name: str, number: signal.Signals) -> Outcome:
    """Kill or hold a node; it has to be noticed, the machine to stand, the policy to be kept."""
    t = await cell.winding()
    spec = next(spec for spec in GRAPH if spec.name == name)
    words, bar = _WORDS[number]
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
    t = await cell.winding()
    injected = time.monotonic()
    lost = cell.orchestrator.process(name).pid
    os.kill(lost, signal.SIGKILL)
    successor = await cell.until(lambda: _successor(cell, name, lost), "a successor")
    os.kill(successor, signal.SIGSTOP)
    given_up = await cell.until(
        lambda: [
            event.text
            for event in cell.log.events
            if event.wall >= injected and event.text.startswith("was not active again")
        ],
        "the successor is given up",
    )
    await _resumed(cell, injected)
    await cell.until(cell.at_full_speed, "full speed again")
    return Outcome(
        fault=f"kill -9 {name}, its successor hangs",
        injected_at=t,
        outcome=f"the successor {given_up[0]}; another one resumes the run",
        survived=cell.goes_on() and cell.orchestrator.process(name).pid not in (lost, successor),
    )


async def lose_again_and_again(cell: FaultCell, name: str) -> Outcome:
    """Kill a node whenever it is there again; the run has to end rather than go on like that."""
    t, kills = await cell.winding(), 0
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


async def break_sensor(cell: FaultCell, fault: SensorFault) -> Outcome:
    """Inject a fault; the machine has to stand, and the run to end with a sentence."""
    t = await cell.winding()
    injected = time.monotonic()
    refused = await cell.inject(fault.inject)
    sentence = refused or await cell.end_of_run()
    began, stood = await cell.stop(since=t)
    # A run may end for a consequence of the fault: the events name the fault itself.
    noted = [event.text for event in cell.log.events if event.wall >= injected]
    by = fault.noticed_by("; ".join([sentence, cell.rig.values.get("reason", ""), *noted]))
    if by == _STAMPS:
        detected = cell.log.find("detected", since=injected)
        assert detected is not None
        began = detected.wall
    return Outcome(
        fault=fault.name,
        injected_at=t,
        detected_by=by,
        detected_after=began - injected,
        detect_within=fault.within,
        stood_after=stood - began,
        outcome=f"the run ended: {sentence}",
        survived=not refused and bool(by),
    )


async def lose_frames(cell: FaultCell) -> Outcome:
    """Lose every fifth frame; the tracker has to answer every other one, and the run to go on."""
    t = await cell.winding()
    lost_before = _lost(cell)
    await cell.inject(f"camera:intermittent:{_LOSS}")
    buffer = cell.recorder.buffer
    await cell.until(lambda: cell.t > t + 2.0, "two more seconds")
    await cell.inject("")
    reached = cell.t - 0.25
    await cell.until(lambda: buffer.last_stamp(topics.TRACKED_MARKERS) > reached, "tracked markers")
    await cell.until(lambda: _lost(cell) > lost_before, "lost frames in /diagnostics")
    frames, answers = (
        {
            message.stamp_ns
            for message in buffer.messages[topic.name]
            if t < message.stamp_ns * 1e-9 < reached
        }
        for topic in (topics.CAMERA_INFO, topics.TRACKED_MARKERS)
    )
    due = round((reached - t) * 200.0)
    share = 1.0 - len(frames) / due
    return Outcome(
        fault="20 % frame loss",
        injected_at=t,
        detected_by="orchestrator (vitals)",
        outcome=f"{share:.0%} of {due} frames lost, {len(frames - answers)} of the others "
        "unanswered; the run went on",
        # Three standard deviations of so many draws.
        survived=frames == answers and abs(share - _LOSS) < 0.06 and cell.goes_on(),
    )


def _lost(cell: FaultCell) -> int:
    status = cell.client.status("orchestrator: vitals")
    return int(status.values.get("lost frames", 0)) if status is not None else 0


async def wrong_parameters(cell: FaultCell) -> Outcome:
    """Parameters out of range, of a wrong type, unknown or fixed; each refused by a sentence."""
    t = await cell.winding()
    answers = {
        "range": await cell.inject("camera:intermittent:1.5"),
        "type": await cell.set_parameter(topics.RIG, "inject_fault", 1.0),
        "unknown": await cell.set_parameter(topics.RIG, "inject_fautl", "camera:off"),
        "fixed": await cell.set_parameter(topics.RIG, "speed", 2.0),
        "unknown target": await cell.inject("camrea:off"),
    }
    return Outcome(
        fault="wrong parameters",
        injected_at=t,
        detected_by="node",
        outcome="; ".join(answers.values()) + "; the run went on",
        survived=await cell.went_on(t) and all(answers.values()),
    )
