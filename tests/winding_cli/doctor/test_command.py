"""`winding doctor` on this machine, as it is and in trouble."""

import json
import os
import resource
from pathlib import Path
from typing import Any

import pytest
from in_process import keeps_schema

from processes import python
from winding_cli.commands import doctor
from winding_ros.graph import DEFAULT_NAMESPACE

pytestmark = pytest.mark.processes

MODULES = (
    "rclpy", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs", "rosgraph_msgs", "sensor_msgs",
    "std_msgs", "std_srvs", "visualization_msgs", "numpy", "scipy", "numba", "cv2", "rosbags",
    "mcap", "uvicorn", "torch", "sklearn",
)  # fmt: skip
CHECKS = [
    "python", *(f"wheel {name}" for name in MODULES),
    "RMW_IMPLEMENTATION", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY",
    "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "FASTRTPS_DEFAULT_PROFILES_FILE",
    "domain", "participant ports", "graphs in the domain",
    "datagrams on the loopback", "multicast on the loopback",
    "middleware", "message exchange", "other nodes in the domain",
    "clock resolution", "time of day", "clock jumps", "time server",
    "disk space", "disk speed",
    "processors", "memory", "open files", "net.core.rmem_max",
    "addresses of the project",
]  # fmt: skip


def test_machine_that_runs_the_tests_passes_every_check(command: Any, tmp_path: Path) -> None:
    done = command("doctor", "--json", tmp_path / "doctor.json", cwd=tmp_path, code=0)
    record = keeps_schema("doctor", (tmp_path / "doctor.json").read_bytes())
    assert record["domain"] == int(os.environ["ROS_DOMAIN_ID"])
    assert [check["check"] for check in record["checks"]] == CHECKS
    assert record["counts"]["FAIL"] == 0
    assert sum(record["counts"].values()) == len(CHECKS)
    for check in record["checks"]:
        assert set(check) == {"check", "level", "found", "advice"}
        assert check["found"]
        # Every warning has its advice.
        assert bool(check["advice"]) is (check["level"] != "OK")
        assert check["check"] in done.stdout
    assert f"{len(CHECKS)} checks, 0 failed" in done.stdout


def test_everything_that_is_wrong_is_reported_in_one_go(command: Any, tmp_path: Path) -> None:
    def lower() -> None:
        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (60, hard))

    wrong = {
        "ROS_DOMAIN_ID": "seven", "RMW_IMPLEMENTATION": "rmw_nowhere", "ROS_LOCALHOST_ONLY": "1",
    }  # fmt: skip
    own = {"env": os.environ | wrong, "preexec_fn": lower}
    done = command("doctor", "--json", "doctor.json", cwd=tmp_path, code=1, **own)
    checks = json.loads((tmp_path / "doctor.json").read_text())["checks"]
    assert [check["check"] for check in checks] == CHECKS
    failed = {check["check"]: check for check in checks if check["level"] == "FAIL"}
    expected = {"RMW_IMPLEMENTATION", "domain", "middleware", "message exchange", "open files"}
    assert set(failed) == expected
    assert "seven" in failed["domain"]["found"]
    assert "60 for each process" in failed["open files"]["found"]
    # Advice names an extra in brackets, which a terminal must show too.
    assert "cable-winding-twin[ros]" in done.stdout


def test_doctor_itself_needs_no_ros() -> None:
    look = (
        "import sys, winding_cli.cli, winding_cli.commands.doctor\n"
        "print('rclpy' in sys.modules, 'sensor_msgs' in sys.modules)"
    )
    assert python(look, timeout=120.0, check=True).stdout == "False False\n"
    assert doctor.NAMESPACE == DEFAULT_NAMESPACE


def test_domain_that_is_none_is_refused_when_it_is_asked_for(command: Any, tmp_path: Path) -> None:
    assert "0 to 232, got 300" in command("doctor", "--domain", 300, cwd=tmp_path, code=2).stderr
