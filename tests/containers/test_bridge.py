"""Each node in a network and a shared memory of its own, on a bridge, as compose runs them."""

import contextlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from processes import COMMAND, ran
from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_ros.graph import GRAPH, RIG

pytestmark = [pytest.mark.campaign, pytest.mark.processes]

DRIVER = Path(__file__).parents[2] / "examples" / "driver_node.py"
PROFILE = Path(__file__).parents[2] / "docker" / "fastdds_bridge.xml"
ENVIRONMENT = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(PROFILE),
}
TAG = f"w{os.getpid()}"


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True, timeout=30)


def inside(number: int) -> list[str]:
    """Return what puts a command into the n-th network, with an empty /dev/shm."""
    own_memory = 'mount -t tmpfs tmpfs /dev/shm && exec "$@"'
    place = ["ip", "netns", "exec", f"{TAG}n{number}", "unshare", "--mount", "--ipc"]
    return [*place, "sh", "-c", own_memory, "sh"]


@pytest.fixture
def bridge() -> Iterator[None]:
    """Join as many networks as there are nodes, and one more, by a bridge."""
    if os.geteuid() != 0 or shutil.which("ip") is None or shutil.which("unshare") is None:
        pytest.skip("networks of their own need root, ip and unshare")
    with contextlib.ExitStack() as undo:
        try:
            ip("link", "add", TAG, "type", "bridge")
            undo.callback(ip, "link", "del", TAG)
            ip("link", "set", TAG, "up")
            for number in range(len(GRAPH) + 1):
                name, port = f"{TAG}n{number}", f"{TAG}p{number}"
                ip("netns", "add", name)
                undo.callback(ip, "netns", "del", name)
                ip("link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", name)
                ip("link", "set", port, "master", TAG, "up")
                ip("-n", name, "address", "add", f"10.77.0.{number + 2}/24", "dev", "eth0")
                ip("-n", name, "link", "set", "eth0", "up")
                ip("-n", name, "link", "set", "lo", "up")
                ip("-n", name, "route", "add", "default", "dev", "eth0")
            subprocess.run([*inside(0), "true"], check=True, capture_output=True, timeout=30)
        except (subprocess.CalledProcessError, PermissionError) as error:
            pytest.skip(f"this machine makes no networks: {getattr(error, 'stderr', error)}")
        yield


def run_inside(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run `winding run` in the last network."""
    words = (*inside(len(GRAPH)), *COMMAND, "run", "--attach", "--case", "4", *options)
    return ran(*words, cwd=folder, env={**os.environ, **ENVIRONMENT}, timeout=240)


@pytest.mark.usefixtures("bridge")
def test_nothing_is_lost_between_containers(keep_nodes: Callable[..., Any], tmp_path: Path) -> None:
    nodes = keep_nodes(tmp_path, inside, ENVIRONMENT)
    done = run_inside(tmp_path, "--namespace", nodes.namespace, "--duration-s", "3", "--bag", "bag")
    assert done.returncode == 0, done.stderr
    assert check(tmp_path / "bag").findings == []
    frames = {topic.name: topic.messages for topic in contents(tmp_path / "bag").topics}
    assert frames[f"/{nodes.namespace}/camera/image_raw"] == 601
    assert frames[f"/{nodes.namespace}/rig/joint_states"] == 3001


@pytest.mark.usefixtures("bridge")
def test_a_driver_of_its_own_is_wound_with(keep_nodes: Callable[..., Any], tmp_path: Path) -> None:
    listeners = tuple(spec for spec in GRAPH if spec is not RIG)
    nodes = keep_nodes(tmp_path, inside, ENVIRONMENT, listeners)
    driver = subprocess.Popen(
        [
            *inside(len(listeners)),
            *(sys.executable, str(DRIVER), "--ros-args", "-r", f"__ns:=/{nodes.namespace}"),
        ],
        env={**os.environ, **ENVIRONMENT},
    )
    try:
        done = run_inside(
            tmp_path,
            *("--namespace", nodes.namespace, "--machine", "external", "--no-camera"),
            *("--duration-s", "5", "--output", "run", "--bag", "bag"),
        )
    finally:
        driver.terminate()
        driver.wait(60)
    assert done.returncode == 0, done.stderr
    assert check(tmp_path / "bag").findings == []
    numbers = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert numbers["joint_states_lost"] == 0
    assert numbers["markers"][0]["s_fem_m"] is not None
