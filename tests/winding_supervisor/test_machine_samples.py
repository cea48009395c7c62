"""What an external machine's samples say of it, whenever they are looked at; a full disk."""

import math
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from axis_readings import axis_reading

from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import DriveProfile
from winding_core.run_outcome import Cause, EndedBy, Motion
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.messages.rig import encode_joint_state
from winding_supervisor.machines.external_machine import ExternalMachine, ExternalMachineConfig
from winding_supervisor.machines.standing_axes import at_rest
from winding_supervisor.watch.event_log import EventLog

DRIVE = DriveProfile()
PERIOD, STOOD = 0.008, 0.6
TURN = 2.0 * math.pi


class Machine:
    """A machine of which samples arrive, looked at when a test asks."""

    def __init__(self, turns: float = 3.0, *, scale: float = 1.0) -> None:
        self.now = 100.0
        self._scale = scale
        self._buffer = RunBuffer([topics.JOINT_STATES])
        config = ExternalMachineConfig(
            axes=MachineAxes(), drive=DRIVE, end_angle=turns * TURN, camera=False,
            starts_itself=False, standing_limit=2.5,
        )  # fmt: skip
        self.seen = ExternalMachine(config, cast(Any, None), self._buffer, lambda: self.now)

    def winds(self, begin: float, end: float, *, holds_at: float = math.inf) -> None:
        """Let samples arrive, from and to a time since its start [s]; it may stand from one on."""
        for t in np.arange(begin, end, PERIOD):
            moved = min(max(float(t), 0.0), holds_at)
            (angle, way), (speed, feed) = DRIVE.positions(moved), DRIVE.speeds(moved)
            moves = 0.0 <= t < holds_at
            turned, turning = (self._scale * float(value) for value in (angle, speed * moves))
            reading = axis_reading(turned, float(way), speed=turning, feed=float(feed) * moves)
            stamp = round(1e9 * (50.0 + t))
            data = bytes(encode_joint_state(50.0 + float(t), reading))
            self._buffer.add(topics.JOINT_STATES, BufferedMessage(stamp, stamp, stamp, data))

    def is_looked_at(self, seconds: float) -> str:
        """Look 20 times a second; return the last complaint."""
        complaint = ""
        for _ in range(round(20.0 * seconds)):
            self.now += 0.05
            complaint = self.seen.complaint()
        return complaint


@pytest.mark.parametrize("late", [0.4, 1.1, 2.3])
def test_a_first_look_that_comes_late_accuses_no_axis(late: float) -> None:
    machine = Machine()
    machine.winds(-STOOD, late)
    assert machine.is_looked_at(0.1) == ""
    # By its samples it began when it began.
    assert machine.seen.began == pytest.approx(50.0, abs=0.3)
    machine.winds(late, 5.0)
    assert machine.is_looked_at(0.1) == ""


def test_a_wrong_scale_is_found_by_a_late_look_as_well() -> None:
    machine = Machine(scale=math.degrees(1.0))
    machine.winds(-STOOD, 2.3)
    assert "cylinder_scale must give radians" in machine.is_looked_at(0.1)


def test_a_machine_that_stands_before_its_end_has_stopped_by_itself() -> None:
    machine = Machine(turns=2.0)
    machine.winds(-STOOD, 7.0, holds_at=3.5)
    machine.is_looked_at(0.1)
    assert machine.seen.end is not None
    early = machine.seen.early
    assert (early.by, early.source) == (EndedBy.MACHINE, "rig/joint_states")
    turns = float(DRIVE.positions(3.5)[0]) / TURN
    assert f"after {turns:.2f} of 2.00 turns and stood for 2.5 s" in early.text


def test_a_machine_that_reaches_its_end_has_not() -> None:
    machine = Machine(turns=0.5)
    machine.winds(-STOOD, 4.0)
    machine.is_looked_at(0.1)
    assert machine.seen.end is not None
    assert machine.seen.early is None


def test_only_a_machine_that_is_seen_standing_stands() -> None:
    machine = Machine()
    machine.winds(-STOOD, 3.0)
    machine.is_looked_at(0.1)
    assert machine.seen.motion is Motion.TURNING
    # Nothing more is heard.
    assert "are silent for" in machine.is_looked_at(2.5)
    assert machine.seen.motion is Motion.UNKNOWN
    machine.winds(3.0, 4.0, holds_at=3.0)
    machine.is_looked_at(0.1)
    assert machine.seen.motion is Motion.STANDING


@pytest.mark.parametrize("file", ["/dev/full", "gone/events.jsonl"])
def test_a_disk_that_takes_no_event_hides_no_event_nor_cause(tmp_path: Path, file: str) -> None:
    log = EventLog(file=tmp_path / file)
    cause = Cause(by=EndedBy.SUPERVISION, source="correction", text="correction is gone", t=1.25)
    log.note("detected", "correction", "ended with exit code -11", t=1.25)
    log.hold(cause)
    log.stop(1.25, "supervision", "")
    later = Cause(by=EndedBy.FAULT, source="orchestrator", text="no space", t=1.5)
    assert log.end(later) is cause
    ending = log.ending(Motion.STANDING)
    assert [event.what for event in ending.events] == ["detected"]
    assert ending.text == "correction is gone"
    assert log.failure.startswith(f"{Path(file).name} is incomplete: ")


def test_a_machine_that_is_still_stopping_is_not_at_rest():
    since, way = np.arange(0.0, 0.5, 0.01), 1.0e-5
    # It has 6 mrad to go, as the one that was taken for standing and had moved when its run began.
    stopping = np.column_stack([-0.01 * np.exp(-since), way * since])
    assert not at_rest(stopping)
    # Less is left than counts as motion.
    assert at_rest(0.1 * stopping)


@pytest.mark.parametrize("rate", [50.0, 500.0])
def test_an_encoder_that_trembles_is_at_rest_within_a_few_looks(rate):
    rng = np.random.default_rng(3)
    looks = rng.uniform(-0.5, 0.5, (8, round(0.5 * rate), 2)) * (0.01, 2.0e-4)
    assert any(at_rest(look) for look in looks)
