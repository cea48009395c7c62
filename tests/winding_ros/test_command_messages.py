"""Commands as messages: what comes back, what is left open, what is refused."""

import math
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory as TrajectoryMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from winding_core.machine.commands import AxisTarget, JointTargets, JointTrajectory, Waypoint
from winding_ros.messages.commands import (
    decode_targets,
    decode_trajectory,
    encode_targets,
    encode_trajectory,
)
from winding_ros.messages.serialised import MessageError

NAMES = ["carriage_joint", "cylinder_joint"]


def test_targets_come_back_with_what_is_left_open() -> None:
    targets = JointTargets(
        t=2.5, axes={"carriage": AxisTarget(position=0.1), "cylinder": AxisTarget(speed=-1.0)}
    )
    assert decode_targets(encode_targets(targets)) == (2.5, targets)


def test_a_joint_with_nothing_but_nan_is_not_commanded() -> None:
    message = JointState(name=NAMES, position=[math.nan, 0.5], velocity=[])
    assert decode_targets(message)[1].axes == {"cylinder": AxisTarget(position=0.5)}


def test_trajectories_come_back() -> None:
    for speed in (None, 0.25):
        plan = JointTrajectory(
            t=1.5, axes={"carriage": (Waypoint(t=0.5, position=0.1, speed=speed),)}
        )
        assert decode_trajectory(encode_trajectory(plan)) == (1.5, plan)


def test_an_empty_trajectory_holds_both_axes() -> None:
    assert decode_trajectory(TrajectoryMessage())[1].axes == {"cylinder": (), "carriage": ()}


def point(seconds: int, *positions: float, velocities: tuple[float, ...] = ()) -> Any:
    return JointTrajectoryPoint(
        positions=positions, velocities=velocities, time_from_start=Duration(sec=seconds)
    )


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (JointState(name=["guide"], position=[0.0]), "joints must be .* got .*guide"),
        (JointState(name=NAMES[:1] * 2, position=[0.0, 0.0]), "each once at most"),
        (JointState(name=NAMES, position=[0.0]), "one for each of 2 joints, got 1"),
        (JointState(name=NAMES[:1], velocity=[math.inf]), "finite or NaN, got velocity"),
        (JointState(name=NAMES[:1], effort=[1.0]), "positions or velocities, got an effort"),
        (JointState(name=NAMES), "a position or a velocity, got none"),
    ],
)
def test_targets_that_cannot_be_are_refused(message: Any, sentence: str) -> None:
    with pytest.raises(MessageError, match=sentence):
        decode_targets(message)


@pytest.mark.parametrize(
    ("names", "points", "sentence"),
    [
        ([], [point(1, 0.0)], "needs joint_names, got none"),
        (NAMES, [point(1, 0.0)], "needs 2 positions in each point"),
        (NAMES[:1], [point(2, 0.0), point(1, 0.1)], "must ascend .* point 1 has 1 s after 2 s"),
        (
            NAMES[:1],
            [point(1, 0.0, velocities=(0.0,)), point(2, 0.1)],
            "velocities in each or none, point 1 has 1 and 0",
        ),
        (NAMES[:1], [point(1, math.nan)], "must be finite, point 0 is not"),
    ],
)
def test_trajectories_that_cannot_be_are_refused(
    names: list[str], points: list[Any], sentence: str
) -> None:
    with pytest.raises(MessageError, match=sentence):
        decode_trajectory(TrajectoryMessage(joint_names=names, points=points))
