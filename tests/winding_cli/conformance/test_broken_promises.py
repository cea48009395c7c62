"""Drivers that break a promise, as processes, looked at by the command."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.processes


@pytest.mark.parametrize(
    ("driver", "broken", "moved"),
    [
        (
            {'"rig/{name}", getattr': '"rig/{name}_", getattr'},
            "BROKEN  rig/start: a std_srvs/srv/Trigger service: not there",
            False,
        ),
        (
            {"0.0, 0.0, True, True": "0.0, 0.0, False, True"},
            "BROKEN  rig/start after an emergency stop",
            True,
        ),
    ],
    indirect=["driver"],
    ids=["without services, which moves nothing", "with an emergency stop that does not latch"],
)
def test_a_driver_that_breaks_a_promise_is_found(
    driver: Any, broken: str, moved: bool, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("conform", "--namespace", driver.namespace, "--no-camera", "--seconds", 0.5, "--move"),
        cwd=tmp_path,
    )
    assert done.returncode == 1
    assert broken in done.stdout
    assert ("both axes wind" in done.stdout) is moved


def test_no_driver_is_reported_in_one_sentence(tmp_path: Path, command: Callable[..., Any]) -> None:
    done = command("conform", "--namespace", "empty", "--no-camera", cwd=tmp_path)
    assert done.returncode == 1
    assert "no sample on rig/joint_states within 10 s" in done.stderr
    assert done.stderr.count("\n") == 1
