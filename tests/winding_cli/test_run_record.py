"""From the messages of a run to its outcome: what was lost, how far it came, what judges it."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from axis_readings import axis_reading
from numpy.typing import NDArray
from rclpy.serialization import serialize_message

from winding_cli.run.outcome import asked_extent, run_outcome
from winding_core.cable.condition import Condition
from winding_core.error_verdict import CAMERA, EXPERIMENT
from winding_core.run_outcome import Cause, EndedBy, Ending, RunOutcome
from winding_core.status import Status
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_reports.records.run_record import MarkerRow
from winding_ros import topics
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.messages.rig import encode_joint_state
from winding_ros.topic import Topic
from winding_supervisor.session.session import RunResult

CONDITION = Condition(case=5, duration=15.0)
PERIOD, SPEED = 0.01, 6.0
Stamps = NDArray[np.float64]


def message(buffer: RunBuffer, topic: Topic, stamp: float, arrived: float, data: bytes) -> None:
    ns = round(1e9 * arrived)
    buffer.add(topic, BufferedMessage(round(1e9 * stamp), ns, ns, data))


def wound(stamps: Callable[[Stamps], Stamps] = lambda t: t, kept: slice | None = None) -> RunBuffer:
    """Return the buffer of three seconds of a machine whose stamps are odd."""
    buffer = RunBuffer([topics.JOINT_STATES, topics.DIAGNOSTICS])
    buffer.origin = 20.0
    arrived = 20.0 + PERIOD * np.arange(301)
    stamped = stamps(arrived.copy())
    gone = set() if kept is None else set(range(301)[kept])
    for k, (t, at) in enumerate(zip(stamped, arrived, strict=True)):
        reading = axis_reading(SPEED * (at - 20.0), speed=SPEED)
        if k not in gone:
            data = encode_joint_state(float(t), reading)
            message(buffer, topics.JOINT_STATES, float(t), 1000.0 + at, data)
    return buffer


def refusing(counts: dict[str, str]) -> RunBuffer:
    buffer = wound()
    reported = encode_diagnostics(22.0, [Status(name="cable_fem: topics", values=counts)])
    message(buffer, topics.DIAGNOSTICS, 22.0, 1022.0, serialize_message(reported))
    return buffer


def later(since: int, by: float, until: int = 301) -> Callable[[Stamps], Stamps]:
    def shifted(t: Stamps) -> Stamps:
        t[since:until] += by
        return t

    return shifted


def trembling(by: float) -> Callable[[Stamps], Stamps]:
    return lambda t: t + np.random.default_rng(8).uniform(-by, by, t.size)


def outcome(
    buffer: RunBuffer, ending: Ending | None = None, rows: tuple[MarkerRow, ...] = (), **more: bool
) -> RunOutcome:
    result = RunResult(buffer=buffer, wall_s=3.0, ending=ending or Ending())
    return run_outcome(
        result, CONDITION, asked_extent(CONDITION, None), rows, None,
        published=more.get("published", False), error_limit_pct=2.5,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("buffer", "sentences"),
    [
        (wound(), []),
        (refusing({"refused rig/joint_states": "23", "queue rig/tension": "4"}),
         ["cable_fem refused 23 messages of rig/joint_states"]),
        (wound(later(120, -0.044, 130)), ["goes back in time 1 times, by 0.034 s at most"]),
        (wound(later(90, 0.7)), ["the clock of rig/joint_states jumps by +0.700 s"]),
        (wound(later(140, -0.3)), ["goes back in time", "jumps by -0.300 s"]),
        (wound(kept=slice(80, 92)), ["12 of 301 messages of rig/joint_states are missing, the "
                                     "largest gap is 0.130 s"]),
        (wound(trembling(0.017)), ["goes back in time"]),
        (wound(trembling(0.004)), []),
        (wound(trembling(0.004), slice(80, 92)), ["messages of rig/joint_states are missing"]),
    ],
    ids=["nothing", "not a number", "back", "clock ahead", "clock behind", "gap", "jitter",
         "less jitter", "jitter and gap"],
)  # fmt: skip
def test_losses_and_odd_stamps_are_in_the_outcome(buffer: RunBuffer, sentences: list[str]) -> None:
    losses = outcome(buffer).losses
    assert len(losses) == len(sentences), losses
    assert all(s in loss for s, loss in zip(sentences, losses, strict=True)), losses
    assert set(losses) <= set(outcome(buffer).sentences)


def test_a_run_is_as_long_as_its_machine_has_turned() -> None:
    cause = Cause(by=EndedBy.MACHINE, source="rig/joint_states", text="it stopped", t=3.0)
    found = outcome(wound(), Ending(cause=cause))
    assert found.done.turns == pytest.approx(3.0 * SPEED / math.tau)
    assert found.done.time == pytest.approx(3.0)
    assert found.done.turns < found.asked.turns
    assert found.verdict.value == "failed"


def row(number: int, corrected: float, tracked: float | None, published: float) -> MarkerRow:
    return MarkerRow(
        id=number, original=0.1 * number, s_fem=0.1 * number, s_corrected=corrected,
        s_tracked=tracked, s_published=published,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("published", "against", "verdict"), [(False, CAMERA, "not good"), (True, EXPERIMENT, "good")]
)
def test_who_measured_this_cable_judges_it(published: bool, against: str, verdict: str) -> None:
    # Beside the published length by 1 %, beside the measured one by 4 %.
    found = outcome(wound(), rows=(row(1, 0.104, 0.1, 0.103),), published=published)
    assert (found.lengths.against, found.verdict.value) == (against, verdict)


def test_a_marker_that_no_camera_measured_leaves_a_run_unjudged() -> None:
    rows = (row(1, 0.1, 0.1, 0.1), row(2, 0.2, None, 0.2))
    assert outcome(wound(), rows=rows).verdict.value == "not judged"
    assert outcome(wound(), rows=rows, published=True).verdict.value == "good"
