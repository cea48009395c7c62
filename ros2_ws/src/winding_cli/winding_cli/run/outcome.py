"""From what a run left to the record of how it came out."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.condition import Condition, ResolvedCondition
from winding_core.run_outcome import Extent, RunOutcome
from winding_recorder.live.run_buffer import RunBuffer
from winding_reports.records.lay_outcome import LayOutcome
from winding_reports.records.run_record import MarkerRow, judge_lengths
from winding_ros import topics
from winding_ros.topic import Topic
from winding_supervisor.session.session import RunResult

_TURN = 2.0 * math.pi
# Stamps that step further than their messages are apart, by more than this, jump [s].
_JUMP = 0.1
_REFUSED = "refused "


def asked_extent(condition: Condition, end_angle: float | None) -> Extent:
    """Return how far a run was to go.

    Args:
        condition: What is wound.
        end_angle: Cylinder angle at which an external run ends [rad]; None where time ends it.
    """
    what = condition.resolved()
    if end_angle is not None:
        return Extent(turns=end_angle / _TURN, length=_wound_length(what, end_angle))
    angle = float(what.drive.positions(condition.duration)[0])
    return Extent(turns=angle / _TURN, time=condition.duration, length=_wound_length(what, angle))


def run_outcome(
    result: RunResult,
    condition: Condition,
    asked: Extent,
    rows: Sequence[MarkerRow],
    lay: LayOutcome | None,
    *,
    published: bool,
    error_limit_pct: float,
) -> RunOutcome:
    """Return how a run came out.

    Args:
        result: What it left.
        condition: What was wound.
        asked: How far it was to go.
        rows: Its markers at the end.
        lay: What became of a wanted lay, if there was one.
        published: Whether the cable lies where the paper's experiment measured it.
        error_limit_pct: Largest error of a corrected length that counts as good [%].
    """
    what, buffer, ending = condition.resolved(), result.buffer, result.ending
    newest = buffer.newest_axis_reading()
    angle = 0.0 if newest is None or buffer.time <= 0.0 else newest[1].cylinder_angle
    length = _wound_length(what, angle)
    completed = ending.cause is None
    wound = [row for row in rows if row.s_fem is not None]
    markers = len(wound)
    if not completed and asked.length is not None:
        ends = (what.case.original_length(row.id) for row in rows)
        markers = max(markers, sum(end <= asked.length for end in ends))
    if published:
        judged = sum(row.s_published is not None for row in wound)
    else:
        # One that has landed in the last turn has not come past the camera as wound cable.
        last_turn = _TURN * what.case.centreline_radius
        judged = sum(
            row.s_tracked is not None or (row.s_fem or 0.0) < length - last_turn for row in wound
        )
    return RunOutcome(
        asked=Extent(turns=asked.turns, time=asked.time, length=asked.length, markers=markers),
        done=Extent(turns=angle / _TURN, time=buffer.time, length=length, markers=len(wound)),
        ending=ending,
        losses=(*result.losses, *_losses(buffer)),
        lengths=judge_lengths(
            rows,
            error_limit_pct,
            published=published,
            asked=judged if completed else markers,
            ended=completed,
        ),
        lay=None if lay is None or not lay.drove else lay.verdict,
    )


def _wound_length(what: ResolvedCondition, angle: float) -> float:
    """Return the length of the helix that is wound at a cylinder angle [rad], in metres."""
    return abs(angle) * math.hypot(what.case.centreline_radius, what.drive.advance_per_radian)


def _losses(buffer: RunBuffer) -> Iterator[str]:
    """Yield what the recorder and the nodes missed or refused, a sentence each."""
    for topic in (topics.JOINT_STATES, topics.TENSION, topics.CAMERA_INFO):
        yield from _stamp_faults(buffer, topic)
    for node, counts in _refusals(buffer).items():
        for topic_name, count in counts.items():
            yield f"{node} refused {count} messages of {topic_name}"


def _stamp_faults(buffer: RunBuffer, topic: Topic) -> Iterator[str]:
    stamps = buffer.stamps(topic) * 1e-9
    steps = np.diff(stamps)
    if len(steps) == 0:
        return
    back = steps[steps < 0.0]
    if back.size:
        yield f"{topic.name} goes back in time {back.size} times, by {-back.min():.3f} s at most"
    usual = float(np.median(steps))
    # A stamp that is late or early is made up for by its neighbours: no message is missing there.
    gaps = steps[steps > 2.5 * usual - steps.min()]
    lost = int((np.round(gaps / usual) - 1.0).sum()) if usual > 0.0 else 0
    jumps = _clock_jumps(buffer, topic)
    if jumps.size:
        yield f"the clock of {topic.name} jumps by {jumps[np.abs(jumps).argmax()]:+.3f} s"
    elif lost:
        yield (
            f"{lost} of {len(stamps) + lost} messages of {topic.name} are missing, the largest gap "
            f"is {steps.max():.3f} s"
        )


def _clock_jumps(buffer: RunBuffer, topic: Topic) -> NDArray[np.float64]:
    """Return by how much stamps step further than arrivals [s], where that is a jump."""
    messages = list(buffer.messages[topic.name])
    stamps = np.array([item.stamp_ns for item in messages], dtype=np.int64)
    arrived = np.array([item.received_ns for item in messages], dtype=np.int64)
    steps, between = np.diff(stamps) * 1e-9, np.diff(arrived) * 1e-9
    # A simulated machine's time has a pace of its own.
    pace = np.median(steps / np.maximum(between, 1e-9)) if len(steps) else 1.0
    if not 0.8 < pace < 1.25:
        return np.zeros(0)
    excess = steps - between
    return excess[(np.abs(excess) > _JUMP) & (np.abs(steps) > _JUMP) & (between < _JUMP)]


def _refusals(buffer: RunBuffer) -> dict[str, dict[str, int]]:
    """Return how many messages each node has refused, by topic."""
    found: dict[str, dict[str, int]] = {}
    for status in buffer.statuses():
        node, _, component = status.name.partition(": ")
        if component == "topics":
            found[node] = {
                key.removeprefix(_REFUSED): int(value)
                for key, value in status.values.items()
                if key.startswith(_REFUSED) and value.isdigit()
            }
    return found
