"""What of a guide's way an arm cannot do is refused ahead, with the place and the number."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from arm_example import arm_file

from winding_core.arm.arm_path import ArmPath
from winding_core.arm.opening import check_arm, open_arm
from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.urdf import BASE, GUIDE, machine_urdf

WHAT = Condition(case=4).resolved()
NEAR = 2.0e-6  # Of inverse kinematics, which end within a micrometre [m]


def opened(file: str) -> ArmPath:
    path = open_arm(file, WHAT)
    assert path is not None
    return path


def test_eye_keeps_the_tangent_plane_and_the_span(tmp_path: Path) -> None:
    path = opened(arm_file(tmp_path, path={"along_m": [0.0, 0.2], "span_m": [0.2, 0.3]}))
    joints = path.start
    for along in np.linspace(0.0, 0.2, 41).tolist():
        joints = path.joints_at(along, joints)
        wanted = [WHAT.case.centreline_radius, -(0.2 + 0.5 * along), along]
        assert path.eye(joints) == pytest.approx(wanted, abs=NEAR)


def test_slopes_are_the_change_of_the_eye(tmp_path: Path) -> None:
    path, step = opened(arm_file(tmp_path)), 1.0e-6
    slopes = path.slopes(path.start)
    for k in range(6):
        one = step * np.eye(6)[k]
        moved = path.eye(path.start + one) - path.eye(path.start - one)
        # Of central differences, and of the arm's metre.
        assert slopes[:, k] == pytest.approx(0.5 * moved / step, abs=1.0e-7)


def test_way_of_the_example_is_allowed(tmp_path: Path) -> None:
    end = WHAT.drive.positions(WHAT.duration)[1]
    check_arm(opened(arm_file(tmp_path)), WHAT, end, WHAT.drive.feed_speed)
    assert open_arm("", WHAT) is None


@pytest.mark.parametrize(
    ("sections", "end", "speed", "sentence"),
    [
        ({}, 0.5, 0.01, r"the guide would go to 0\.5 m, beyond its travel of -0\.05 to 0\.4 m"),
        ({}, -0.06, 0.01, r"the guide would go to -0\.06 m, beyond its travel"),
        ({}, 0.1, 0.1, r"the guide would go at 0\.1 m/s, its largest speed is 0\.08 m/s"),
        ({"commands": {"high_m": 2.0}}, 1.5, 0.01,
         r"the arm does not reach \(.*\) m with its tool turned as it is"),
        ({"commands": {"speed_m_s": 5.0}}, 0.1, 4.0,
         r"at 0 m the guide would go at 4 m/s, \w+_joint allows [\d.]+ m/s there"),
        ({"path": {"clearance_m": 0.2}}, 0.1, 0.01,
         r"with the guide at 0 m the arm comes as near as 1\d\d mm to the cylinder, its "
         r"clearance is 200 mm"),
        ({"path": {"home_rad": [0.0, 1.0]}}, 0.1, 0.01,
         r"home_rad of path needs a position for each of shoulder_pan_joint, .*, got 2"),
        ({"path": {"along_m": [0.1, 0.0], "span_m": [0.2, 0.3]}}, 0.1, 0.01,
         r"along_m must ascend and span_m hold as many positive lengths, got \[0\.1, 0\.0\]"),
        ({"guide": {"urdf": ""}}, 0.1, 0.01, r"need the arm's urdf"),
        ({"winder_axis": {"position_m": [5.0, 0.0, 0.0]}}, 0.1, 0.01, r"does not reach"),
    ],
)  # fmt: skip
def test_what_the_arm_cannot_do_is_refused_with_its_number(
    tmp_path: Path, sections: dict[str, dict[str, object]], end: float, speed: float, sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        check_arm(opened(arm_file(tmp_path, **sections)), WHAT, np.array([end]), speed)


def test_description_of_the_machine_holds_the_arm_and_its_eye(tmp_path: Path) -> None:
    path = opened(arm_file(tmp_path))
    urdf = machine_urdf(WHAT, MachineAxes(), arm=path)
    joints = path.joints_at(0.1, path.start)
    # Pinocchio reads the whole description; the joints of rig/joint_states move it.
    model = pinocchio.buildModelFromXML(urdf)
    data, q = model.createData(), pinocchio.neutral(model)
    for joint, position in zip(path.arm.joints, joints.tolist(), strict=True):
        q[model.joints[model.getJointId(joint.name)].idx_q] = position
    pinocchio.framesForwardKinematics(model, data, q)
    base, guide = (data.oMf[model.getFrameId(name)] for name in (BASE, GUIDE))
    seen = base.actInv(guide)
    assert seen.translation == pytest.approx(
        [WHAT.case.centreline_radius, -WHAT.free_length, 0.1], abs=NEAR
    )
    # The guide's axes are those of the machine, so that the load cell looks along the span.
    assert seen.rotation == pytest.approx(np.eye(3), abs=1.0e-5)
    names = {item.get("name") for item in ET.fromstring(urdf).iterfind("joint")}
    assert "carriage_joint" not in names
