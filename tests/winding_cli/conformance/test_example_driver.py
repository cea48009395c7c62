"""The example driver of the tutorial as a process, looked at by the command."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

DRIVER = Path(__file__).parents[3] / "examples" / "driver_node.py"

pytestmark = [pytest.mark.processes, pytest.mark.xdist_group("conformance")]


@pytest.fixture
def driver(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """Run the driver, its source changed as the test asks; yield its namespace."""
    source = DRIVER.read_text(encoding="utf-8")
    for old, new in getattr(request, "param", {}).items():
        assert old in source
        source = source.replace(old, new)
    script = tmp_path / "driver.py"
    script.write_text(source, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(script), "--ros-args", "-r", "__ns:=/conform"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    try:
        assert any("ready" in line for line in process.stderr)
        yield "conform"
        process.terminate()
        assert process.wait(timeout=60) == 0
    finally:
        process.kill()


def test_the_example_keeps_every_promise(
    driver: str, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("conform", "--namespace", driver, "--no-camera", "--seconds", 1, "--move"), cwd=tmp_path
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "BROKEN" not in done.stdout
    assert "rig/start after an emergency stop: refused until rig/reset" in done.stdout


@pytest.mark.parametrize(
    "driver", [{'"rig/{name}", getattr': '"rig/{name}_", getattr'}], indirect=True
)
def test_missing_services_are_found_and_nothing_is_moved(
    driver: str, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("conform", "--namespace", driver, "--no-camera", "--seconds", 0.5, "--move"), cwd=tmp_path
    )
    assert done.returncode == 1
    assert "BROKEN  rig/start: a std_srvs/srv/Trigger service: not there" in done.stdout
    assert "both axes wind" not in done.stdout


@pytest.mark.parametrize(
    "driver",
    [{"0.0, 0.0, True, True": "0.0, 0.0, False, True"}],
    indirect=True,
)
def test_an_emergency_stop_that_does_not_latch_is_found(
    driver: str, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("conform", "--namespace", driver, "--no-camera", "--seconds", 0.5, "--move"), cwd=tmp_path
    )
    assert done.returncode == 1
    assert "BROKEN  rig/start after an emergency stop" in done.stdout


def test_no_driver_is_said_in_one_sentence(tmp_path: Path, command: Callable[..., Any]) -> None:
    done = command("conform", "--namespace", "nobody", "--no-camera", cwd=tmp_path)
    assert done.returncode == 1
    assert "no sample on rig/joint_states within 10 s" in done.stderr
    assert done.stderr.count("\n") == 1
