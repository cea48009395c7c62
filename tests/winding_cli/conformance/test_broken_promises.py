"""Drivers that break a promise, as processes, looked at by the command."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.processes


@pytest.mark.parametrize(
    "driver", [{'"rig/{name}", getattr': '"rig/{name}_", getattr'}], indirect=True
)
def test_missing_services_are_found_and_nothing_is_moved(
    driver: Any, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("conform", "--namespace", driver.namespace, "--no-camera", "--seconds", 0.5, "--move"),
        cwd=tmp_path,
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
    driver: Any, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("conform", "--namespace", driver.namespace, "--no-camera", "--seconds", 0.5, "--move"),
        cwd=tmp_path,
    )
    assert done.returncode == 1
    assert "BROKEN  rig/start after an emergency stop" in done.stdout


def test_no_driver_is_said_in_one_sentence(tmp_path: Path, command: Callable[..., Any]) -> None:
    done = command("conform", "--namespace", "nobody", "--no-camera", cwd=tmp_path)
    assert done.returncode == 1
    assert "no sample on rig/joint_states within 10 s" in done.stderr
    assert done.stderr.count("\n") == 1
