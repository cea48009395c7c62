"""Frames as TF has them: the guide through a tree with offsets, and trees that are none."""

import numpy as np
import pytest

from winding_arm_driver.guide import FrameTree, Guided
from winding_core.arm.arm_file import ArmMapping, Commands, Cylinder, Guide, WinderAxis
from winding_core.arm.rigid import Pose

# A quarter turn about z.
QUARTER = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
STRAIGHT = [0.0, 0.0, 0.0, 1.0]


def test_tip_is_found_through_the_ancestor_of_both_frames() -> None:
    tree = FrameTree()
    tree.add("cell", "floor", Pose.of([1.0, 0.0, 0.0], STRAIGHT))
    tree.add("floor", "base", Pose.of([0.0, 0.5, 0.0], QUARTER))
    tree.add("cell", "rail", Pose.of([0.0, 2.0, 0.0], STRAIGHT))
    assert tree.between("base", "tool") is None
    tree.add("rail", "tool", Pose.of([0.0, 0.0, 0.3], STRAIGHT))
    found = tree.between("base", "tool")
    # From (1, 0.5, 0) to (0, 2, 0.3) in the cell, seen in axes that are turned by a quarter.
    assert found.position == pytest.approx([1.5, 1.0, 0.3])
    assert found.rotation @ [0.0, 1.0, 0.0] == pytest.approx([1.0, 0.0, 0.0])


def test_frames_that_lead_in_a_circle_are_refused() -> None:
    tree = FrameTree()
    tree.add("a", "b", Pose.standing())
    tree.add("b", "a", Pose.standing())
    with pytest.raises(ValueError, match="the parents of frame a lead in a circle"):
        tree.between("a", "c")


def test_guide_is_read_from_transforms() -> None:
    guide = Guide(source="tf", base="base", tip="tool", eye_m=[0.0, 0.0, 0.1])
    guided = Guided(
        ArmMapping(
            cylinder=Cylinder(),
            guide=guide,
            winder_axis=WinderAxis(position_m=[0.5, 0.0, 0.0]),
            commands=Commands(),
        )
    )
    guided.add_transform("base", "flange", Pose.of([0.5, 0.0, 0.2], QUARTER))
    guided.add_transform("flange", "tool", Pose.of([-0.2, -0.02, 0.0], STRAIGHT))
    guided.look_up({"flange": 6, "tool": 7, "camera": 9}, 0.0)
    guided.add_cylinder(7, 1.0, 0.0)
    # Of a vehicle, and of the base itself in the cell: the guide stands in the base as before.
    guided.add_transform("cell", "base", Pose.of([5.0, 0.0, 0.0], STRAIGHT))
    guided.look_up({"vehicle": 8, "base": 8}, 0.0)
    ((stamp, reading),) = guided.readings(0.0)
    assert stamp == 7
    assert (reading.guide.x, reading.guide.y) == pytest.approx((0.02, -0.2))
    assert reading.carriage_position == pytest.approx(0.3)
