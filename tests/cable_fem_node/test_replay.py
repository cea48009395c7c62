"""A solver that is started in the middle of a run winds what was wound before it."""

from pathlib import Path
from typing import Any

import numpy as np

from cable_fem_node.ros.message_handler import FemHandler
from cable_fem_node.ros.parameters import FemParameters
from winding_core.machine.drive import DriveProfile
from winding_core.machine.readings import AxisReading
from winding_core.markers import MARKER_DTYPE
from winding_core.run_inputs import INPUT_DTYPE, RunInputs
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.messages.stamps import decode_stamp, encode_stamp

DURATION = 0.6
CUT = 400


def message_pairs() -> list[tuple[float, AxisReading, float | None]]:
    drive = DriveProfile()
    rows = []
    for k in range(600):
        # As a stamp says it: in whole nanoseconds.
        t = decode_stamp(encode_stamp(2.0 + 1.0e-3 * k))
        tension = 3.9 + 0.01 * (k // 10 % 7) if k % 10 == 0 else None
        rows.append((t, drive.reading_at(t - 2.0), tension))
    return rows


def feed(handler: FemHandler, rows: Any) -> list[tuple[float, Any]]:
    """Give an handler the machine's messages; return (t, markers) of its answers."""
    answers = []
    for t, reading, tension in rows:
        taken = []
        if tension is not None:
            taken += handler.take(topics.TENSION, encode_tension(t, tension))
        taken += handler.take(topics.JOINT_STATES, encode_joint_state(t, reading))
        answers += [
            decode_cloud(answer.message, MARKER_DTYPE)
            for answer in taken
            if answer.topic is topics.FEM_MARKERS
        ]
    return answers


def begun(**parameters: Any) -> FemHandler:
    handler = FemHandler(FemParameters(duration=DURATION, **parameters))
    list(handler.begin(0.0))
    return handler


def written(file: Path) -> Path:
    samples = np.zeros(CUT, dtype=INPUT_DTYPE)
    newest = np.nan
    for k, (t, reading, tension) in enumerate(message_pairs()[:CUT]):
        newest = tension if tension is not None else newest
        samples[k] = (
            t,
            reading.cylinder_angle,
            reading.angular_speed,
            reading.carriage_position,
            reading.feed_speed,
            newest,
        )
    RunInputs(samples=samples).write(file)
    return file


def test_successor_says_what_its_predecessor_would_have_said(tmp_path: Path) -> None:
    rows = message_pairs()
    unbroken = begun()
    feed(unbroken, rows[:CUT])
    wanted = feed(unbroken, rows[CUT:])
    successor = begun(replay=str(written(tmp_path / "inputs.npy")))
    assert successor.replayed is not None
    assert abs(successor.replayed - (CUT - 1) * 1.0e-3) < 1e-9
    got = feed(successor, rows[CUT:])
    assert [t for t, _ in got] == [t for t, _ in wanted]
    for (_, one), (_, other) in zip(got, wanted, strict=True):
        np.testing.assert_array_equal(one, other)


def test_run_after_a_replayed_one_begins_at_its_own_start(tmp_path: Path) -> None:
    successor = begun(replay=str(written(tmp_path / "inputs.npy")))
    list(successor.begin(0.0))
    assert successor.model is not None
    assert successor.model.time == 0.0
    assert not successor.following
