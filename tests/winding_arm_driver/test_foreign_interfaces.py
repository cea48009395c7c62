"""Transforms and actions: interfaces that the wheels lack, built here as on a stock workspace."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from arms import mapping_of
from listening import Listener
from rclpy.node import Node

from processes import PATIENCE, in_namespace, running

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(0)]

HERE, NAMESPACE = Path(__file__).parent, "own_cell"


@pytest.fixture(scope="module")
def interfaces(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the environment of a process that has tf2_msgs and control_msgs."""
    if not shutil.which("cmake") or not shutil.which("c++"):
        pytest.skip("interfaces are built with cmake and a C++ compiler")
    folder, prefix = tmp_path_factory.mktemp("interfaces"), sys.prefix
    done = subprocess.run(
        [
            *("colcon", "--log-base", "log", "build", "--merge-install"),
            *("--base-paths", HERE / "interfaces"),
            *("--cmake-args", f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF"),
        ],
        env={
            **os.environ,
            "PATH": f"{prefix}/bin:{os.environ['PATH']}",
            "AMENT_PREFIX_PATH": prefix,
            "CMAKE_PREFIX_PATH": prefix,
        },
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (site,) = folder.glob("install/lib/python3*/site-packages")
    before = {
        "PYTHONPATH": str(site),
        "LD_LIBRARY_PATH": f"{folder}/install/lib",
        "AMENT_PREFIX_PATH": f"{folder}/install{os.pathsep}{prefix}",
    }
    joined = {
        key: os.pathsep.join([value, os.environ.get(key, "")]) for key, value in before.items()
    }
    return os.environ | joined


@contextmanager
def driven(
    env: dict[str, str], folder: Path, source: str, kind: str, ending: str
) -> Iterator[None]:
    """Run an arm and its driver until the end of the body."""
    mapping_of(folder, source, kind)
    file = folder / "mapping.yaml"
    words = ("-m", "winding_arm_driver", "--mapping", file, *in_namespace(NAMESPACE))
    with (
        running(HERE / "own_arm.py", file, ending, ready="ready", env=env),
        running(*words, ready="ready", env=env),
    ):
        yield


@pytest.mark.parametrize(
    ("source", "kind"), [("tf", "pose"), ("tf", "twist"), ("joints", "action")]
)
def test_arm_is_followed_and_led(
    ros: Any, interfaces: dict[str, str], tmp_path: Path, source: str, kind: str
) -> None:
    listener, goal = Listener(ros.add(Node, "listener", namespace=NAMESPACE)), 0.03
    with driven(interfaces, tmp_path, source, kind, "follow"):
        ros.spin_until(lambda: listener.readings)

        def arrived() -> bool:
            listener.aim(goal)
            return abs(listener.readings[-1].carriage_position - goal) < 5.0e-4

        ros.spin_until(arrived, 10.0 * PATIENCE)
        guide = listener.readings[-1].guide
    assert (guide.x, guide.y) == pytest.approx((0.02, -0.2), abs=1.0e-5)


@pytest.mark.parametrize(
    ("ending", "sentence"),
    [
        ("reject", "arm/command rejected a trajectory"),
        ("abort", "arm/command aborted a trajectory: pan left its tolerance"),
        ("absent", "there is no action server arm/command"),
    ],
)
def test_goal_that_is_not_followed_is_reported(
    ros: Any, interfaces: dict[str, str], tmp_path: Path, ending: str, sentence: str
) -> None:
    listener = Listener(ros.add(Node, "listener", namespace=NAMESPACE))
    with driven(interfaces, tmp_path, "joints", "action", ending):
        ros.spin_until(lambda: listener.readings)

        def reported() -> bool:
            listener.aim(0.03)
            return any(sentence in text for text in listener.messages)

        ros.spin_until(reported, 10.0 * PATIENCE)
    assert listener.readings[-1].carriage_position == pytest.approx(0.0, abs=1.0e-8)
