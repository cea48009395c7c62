"""The workspace under colcon, as on stock ROS 2; here the wheels are the underlay."""

import os
import re
import sys
from pathlib import Path

import pytest

from processes import ran

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

WORKSPACE = Path(__file__).parents[1] / "ros2_ws"
PACKAGES = {path.parent.name for path in (WORKSPACE / "src").glob("*/package.xml")}


def environment(**more: str) -> dict[str, str]:
    prefix = sys.prefix
    return {
        **os.environ,
        "PATH": f"{prefix}/bin:{os.environ['PATH']}",
        "AMENT_PREFIX_PATH": prefix,
        "CMAKE_PREFIX_PATH": prefix,
        **more,
    }


def colcon(verb: str, folder: Path, *arguments: str) -> str:
    done = ran(
        *("colcon", "--log-base", folder / "log", verb, "--merge-install"),
        *("--base-paths", WORKSPACE / "src", "--build-base", folder / "build"),
        *("--install-base", folder / "install", *arguments),
        env=environment(), cwd=folder, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("colcon")
    colcon("build", folder)
    return folder


def test_every_package_is_in_the_ament_index(workspace: Path) -> None:
    index = workspace / "install/share/ament_index/resource_index/packages"
    assert {path.name for path in index.iterdir()} == PACKAGES


def test_the_installed_command_runs_from_its_own_files(workspace: Path) -> None:
    install = workspace / "install"
    (site,) = install.glob("lib/python3*/site-packages")
    words = (install / "lib/winding_cli/winding", "predict", "--case", 4, "--duration-s=1")
    done = ran(*words, env=environment(PYTHONPATH=str(site)), cwd=workspace, timeout=240)
    assert done.returncode == 0, done.stderr
    assert re.search(r"P1\b", done.stdout)


def test_the_launch_file_is_installed(workspace: Path) -> None:
    installed = workspace / "install/share/winding_bringup/launch/twin.launch.py"
    source = WORKSPACE / "src/winding_bringup/winding_bringup/launch/twin.launch.py"
    assert installed.read_bytes() == source.read_bytes()


def test_colcon_test_runs_the_tests_of_a_room(workspace: Path) -> None:
    colcon("test", workspace, "--packages-select", "winding_core", "--return-code-on-test-failure")
    report = (workspace / "build/winding_core/pytest.xml").read_text(encoding="utf-8")
    (count,) = re.findall(r'tests="(\d+)"', report)
    assert int(count) > 100
