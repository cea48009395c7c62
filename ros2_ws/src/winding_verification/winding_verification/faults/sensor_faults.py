"""A sensor or a topic of the machine says nothing, the wrong thing, or what cannot be."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

from winding_ros import topics
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.outcome import NOTICE_WITHIN, Outcome

# A stop of the machine's own begins after 50 ms, or 300 ms for a load cell that never changes.
_OWN_WITHIN = 0.4
# A topic may be late for 2 s, on a busy machine, before it is called silent.
_SILENCE_WITHIN = 2.8
_LOSS = 0.2
_RIG = "winding_rig (plausibility)"
_FEM, _TRACKER, _READERS = "cable_fem (intake)", "marker_tracker (intake)", "readers (intake)"
_STAMPS = "orchestrator (stamps)"


@dataclass(frozen=True, kw_only=True)
class SensorFault:
    """A fault that has to end in a standstill.

    Attributes:
        name: As the table calls it.
        text: For the parameter `inject_fault`.
        said: What the end of the run has to say, with who notices then; whichever of several
            is the first.
        within: Bar of the detection [s].
    """

    name: str
    text: str
    said: Mapping[str, str]
    within: float = _OWN_WITHIN

    def noticed_by(self, sentences: str) -> str:
        """Return who noticed, as the graph tells; nothing when it says something else."""
        return next((by for said, by in self.said.items() if said in sentences), "")


STOPPING = (
    SensorFault(
        name="load cell drop-out",
        text="load_cell:off",
        said={"load cell gives no valid reading": _RIG},
    ),
    SensorFault(
        name="NaN from the load cell",
        text="load_cell:garbage",
        said={"load cell gives no valid reading": _RIG},
    ),
    SensorFault(
        name="stuck load cell",
        text="load_cell:stuck",
        said={"load cell is stuck": _RIG},
        within=0.6,
    ),
    SensorFault(
        name="tension out of range",
        text="load_cell:wrong:10",
        said={
            "tension is outside": _RIG,
            "refused a message on rig/tension: tension must be at most": _FEM,
        },
        within=NOTICE_WITHIN,
    ),
    SensorFault(
        name="stuck encoder",
        text="cylinder_encoder:stuck",
        said={"cylinder encoder is stuck": _RIG},
    ),
    SensorFault(
        name="reversed encoder",
        text="cylinder_encoder:wrong:-1",
        said={"cylinder encoder gives no valid reading": _RIG},
    ),
    SensorFault(
        name="NaN on rig/tension",
        text="rig/tension:garbage",
        said={"cable_fem refused a message on rig/tension: tension must be finite": _FEM},
        within=NOTICE_WITHIN,
    ),
    SensorFault(
        name="rig/tension out of range",
        text="rig/tension:wrong:1e6",
        said={"cable_fem refused a message on rig/tension: tension must be at most": _FEM},
        within=NOTICE_WITHIN,
    ),
    SensorFault(
        name="garbage on rig/joint_states",
        text="rig/joint_states:garbage",
        said={"refused a message on rig/joint_states: joint state must be finite": _READERS},
        within=NOTICE_WITHIN,
    ),
    SensorFault(
        name="speed over limit",
        text="rig/joint_states:wrong:10",
        said={"refused a message on rig/joint_states: cylinder must not be faster": _FEM},
        within=NOTICE_WITHIN,
    ),
    SensorFault(
        name="garbage on camera/camera_info",
        text="camera/camera_info:garbage",
        said={"refused a message on camera/camera_info": _TRACKER},
        within=NOTICE_WITHIN,
    ),
    SensorFault(
        name="silent rig/tension",
        text="rig/tension:off",
        said={"rig/tension is silent": _STAMPS},
        within=_SILENCE_WITHIN,
    ),
    SensorFault(
        name="silent camera",
        text="camera:off",
        said={"camera/camera_info is silent": _STAMPS},
        within=_SILENCE_WITHIN,
    ),
    SensorFault(
        name="clock jump",
        text="/clock:wrong:2",
        said={"/clock says": _STAMPS},
        within=_SILENCE_WITHIN,
    ),
)


async def break_sensor(cell: FaultCell, fault: SensorFault) -> Outcome:
    """Put a fault in; the machine has to stand, and the run to end with a sentence."""
    await cell.winding()
    t = cell.t
    injected = time.monotonic()
    refused = await cell.inject(fault.text)
    sentence = refused or await cell.end_of_run()
    await cell.until(lambda: cell.stood(since=t), "standstill")
    began, stood = cell.stop_began(since=t), cell.stood(since=t)
    # A run may end for what came of the fault: what was detected says what it was.
    noted = [event.text for event in cell.log.events if event.wall >= injected]
    by = fault.noticed_by("; ".join([sentence, cell.rig.values.get("reason", ""), *noted]))
    if by == _STAMPS:
        detected = cell.log.find("detected", since=injected)
        assert detected is not None
        began = detected.wall
    assert began is not None
    assert stood is not None
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
    await cell.winding()
    t = cell.t
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
