"""The driver beside an arm of its own joints, dead time and command type, over real DDS."""

import math
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from arms import HOME, mapping_of, mapping_text
from listening import Listener
from own_arm import TURN, OwnArm

from winding_arm_driver.node import ArmDriverNode
from winding_ros import topics


@pytest.mark.parametrize(
    ("source", "kind"),
    [("joints", "trajectory"), ("joints", "positions"), ("pose", "pose"), ("pose", "twist")],
)
def test_an_own_arm_is_followed_and_led(ros: Any, tmp_path: Path, source: str, kind: str) -> None:
    mapping = mapping_of(tmp_path, source, kind)
    ros.add(ArmDriverNode, mapping)
    arm, listener = OwnArm(ros.plain("cell"), mapping), Listener(ros.plain("listener"))
    readings = listener.readings
    ros.spin_until(lambda: readings)
    first = readings[-1]
    steps = math.degrees(first.cylinder_angle) - TURN
    assert steps == pytest.approx(0.5 * round(2.0 * steps), abs=1.0e-9)
    # Of the decimals in mapping and description [m].
    assert (first.guide.x, first.guide.y) == pytest.approx((0.02, -0.2), abs=1.0e-8)
    assert first.carriage_position == pytest.approx(0.0, abs=1.0e-8)
    goal = 0.03

    def aimed() -> bool:
        listener.aim(goal)
        return abs(arm.eye()[2] - goal) < 5.0e-4

    ros.spin_until(aimed)
    ros.spin_until(lambda: readings[-1].carriage_position == pytest.approx(arm.eye()[2], abs=1e-4))
    assert arm.eye()[:2] == pytest.approx((0.02, -0.2), abs=1.0e-5)


def test_what_cannot_be_used_is_reported_with_its_number(ros: Any, tmp_path: Path) -> None:
    mapping = mapping_of(tmp_path, "joints", "trajectory")
    ros.add(ArmDriverNode, mapping)
    arm, listener = OwnArm(ros.plain("cell"), mapping), Listener(ros.plain("listener"))
    sentence = "must stay within -0.05 to 0.5 m, got 0.7 m"

    def reported() -> bool:
        listener.aim(0.7)
        return any(sentence in text for text in listener.messages)

    ros.spin_until(reported)
    assert arm.joints == pytest.approx(HOME)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"guide": {"source": "tf"}}, "source tf needs the interfaces of tf2_msgs"),
        ({"guide": {"source": "joints", "urdf": "none.urdf"}}, "none.urdf is no robot description"),
        ({"guide": {"source": "yoints"}}, "source must be one of joints, pose, tf, got 'yoints'"),
    ],
)
def test_mapping_that_cannot_be_used_ends_the_driver(
    tmp_path: Path, change: dict[str, dict[str, str]], sentence: str
) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text(yaml.safe_dump(change))
    command = [sys.executable, "-m", "winding_arm_driver", "--mapping", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.processes
def test_driver_ends_with_zero_on_a_signal(ros: Any, tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text(mapping_text(tmp_path))
    command = [sys.executable, "-m", "winding_arm_driver", "--mapping", str(file)]
    driver = subprocess.Popen(command)
    try:
        node = ros.plain()
        ros.spin_until(lambda: node.count_publishers(topics.JOINT_STATES.name) == 1)
        driver.send_signal(signal.SIGINT)
        assert driver.wait() == 0
    finally:
        driver.kill()
