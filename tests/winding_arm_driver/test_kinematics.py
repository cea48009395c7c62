"""Kinematics against Denavit-Hartenberg numbers, and poses that the arm cannot take."""

from pathlib import Path

import numpy as np
import pytest
from arms import HOME, NAMES, tool, written

from winding_core.arm.joint import ArmError
from winding_core.arm.kinematics import Arm
from winding_core.arm.rigid import Pose

ROUNDING = 1.0e-9  # Of rounding through the description's decimals [m]


@pytest.fixture
def arm(tmp_path: Path) -> Arm:
    return Arm(written(tmp_path), "base_link", "tool0")


def test_tip_stands_where_the_links_put_it(arm: Arm) -> None:
    assert [joint.name for joint in arm.joints] == list(NAMES)
    rng = np.random.default_rng(1)
    for q in rng.uniform(-3.0, 3.0, (20, 6)):
        placed, wanted = arm.tip(q), tool(q)
        assert placed.position == pytest.approx(wanted[:3, 3], abs=ROUNDING)
        assert placed.rotation == pytest.approx(wanted[:3, :3], abs=ROUNDING)


def test_joints_are_found_for_a_pose_near_by(arm: Arm) -> None:
    rng = np.random.default_rng(2)
    for step in rng.uniform(-0.05, 0.05, (20, 6)):
        assert arm.solved(arm.tip(HOME + step), HOME) == pytest.approx(HOME + step, abs=1.0e-4)


def test_jacobian_is_the_change_of_the_tip(arm: Arm) -> None:
    step = 1.0e-6
    slopes = arm.jacobian(HOME)
    turn = arm.tip(HOME).rotation
    for k in range(6):
        one = step * np.eye(6)[k]
        moved = arm.tip(HOME + one).position - arm.tip(HOME - one).position
        # Of central differences, and of the arm's metre.
        assert turn @ slopes[:3, k] == pytest.approx(0.5 * moved / step, abs=1.0e-7)


def test_pose_beyond_the_arm_is_refused_with_its_place(arm: Arm) -> None:
    home = arm.tip(HOME)
    far = Pose(position=np.add(home.position, [3.0, 0.0, 0.0]), rotation=home.rotation)
    with pytest.raises(ArmError, match=r"the arm does not reach \(.*\) m"):
        arm.solved(far, HOME)


def test_travel_of_a_joint_is_kept(tmp_path: Path) -> None:
    arm = Arm(written(tmp_path, travel=1.95), "base_link", "tool0")
    beyond = HOME - [0.0, 0.1, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(ArmError, match=r"lift would go to -2, beyond its travel of -1.95 to 1.95"):
        arm.solved(arm.tip(beyond), HOME)


@pytest.mark.parametrize(
    ("base", "tip", "sentence"),
    [
        ("base", "tool0", "has no link base, it has .*base_link"),
        ("base_link", "base_link", "no joint moves base_link in base_link"),
    ],
)
def test_missing_links_are_named(tmp_path: Path, base: str, tip: str, sentence: str) -> None:
    with pytest.raises(ArmError, match=sentence):
        Arm(written(tmp_path), base, tip)


def test_file_that_is_no_description_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text("<robot>")
    with pytest.raises(ArmError, match=r"arm.urdf is no robot description"):
        Arm(file, "base_link", "tool0")
