"""`winding run --machine external` with a driver that keeps the tutorial's table and no more."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from processes import COMMAND, child_of, until

pytestmark = [
    pytest.mark.processes,
    pytest.mark.timeout(600),
]

# P1 of case 4 has landed by then, and P2 has not.
DURATION = "5"


@pytest.fixture
def wind(driver: Any, tmp_path: Path, command: Callable[..., Any]) -> Callable[..., Any]:
    """Wind case 4 with the driver; the run's folder is `run`."""

    def run(*further: object) -> Any:
        return command(
            *("run", "--case", 4, "--machine", "external", "--no-camera"),
            *("--namespace", driver.namespace, "--duration-s", DURATION),
            *("--output", tmp_path / "run", *further),
            cwd=tmp_path,
        )

    return run


def numbers(folder: Path) -> Any:
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


# The machine's speeds are those of its encoder, so a different place of the origin, direction
# and unit change a length by no more than rounding: the specification's 0.05 %.
SAME = 5.0e-4


@pytest.mark.parametrize(
    "driver",
    [
        {
            "[self.angle, self.carriage]": "[37.2 - self.angle, 100.0 - 1e3 * self.carriage]",
            "            state.velocity = [self.share * OMEGA, feed]\n": "",
            '"cylinder_joint", "carriage_joint"': '"spindle", "slide"',
            "PERIOD, OMEGA, FEED = 0.002": "PERIOD, OMEGA, FEED = 0.010",
        }
    ],
    indirect=True,
)
def test_offset_reversed_renamed_positions_in_millimetres_at_100_hz_make_no_difference(
    wind: Callable[..., Any], tmp_path: Path, predicted_p1: float
) -> None:
    done = wind(
        *("--cylinder-joint", "spindle", "--carriage-joint", "slide"),
        *("--cylinder-scale", -1.0, "--carriage-scale", -0.001),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = numbers(tmp_path / "run")["markers"][0]["s_fem_m"]
    assert found == pytest.approx(predicted_p1, rel=SAME)


@pytest.mark.parametrize("driver", [{"[self.angle, self": "[-self.angle, self"}], indirect=True)
def test_a_reversed_axis_is_named_and_what_was_wound_is_kept(
    wind: Callable[..., Any], tmp_path: Path
) -> None:
    done = wind()
    assert done.returncode == 1
    assert "the cylinder turned backwards" in done.stderr
    assert "the cylinder turned backwards" in numbers(tmp_path / "run")["ended"]
    page = (tmp_path / "run" / "report" / "index.html").read_text(encoding="utf-8")
    assert "ended by the machine after" in page


SERVE = 'f"rig/{name}", getattr(self, name)'
RESET = "    def reset(self"
# It goes on measuring, and never answers while it lives.
HANG = """\
    def hang(self, _, response):
        while not ended.is_set():
            self.sample()
        return response

"""


@pytest.mark.parametrize(
    ("driver", "failure"),
    [
        (
            {SERVE: '"rig/" + ("no_" * ("stop" in name)) + name, getattr(self, name)'},
            "rig/quick_stop has no server; rig/stop has no server",
        ),
        (
            {
                SERVE: 'f"rig/{name}", self.hang if "stop" in name else getattr(self, name)',
                RESET: HANG + RESET,
            },
            "no answer from rig/quick_stop in 0.8 s; no answer from rig/stop in 0.8 s",
        ),
    ],
    indirect=["driver"],
    ids=["missing", "hanging"],
)
def test_a_stop_that_cannot_be_delivered_ends_the_run(
    driver: Any, failure: str, tmp_path: Path
) -> None:
    errors = tmp_path / "stderr"
    with errors.open("w", encoding="utf-8") as stderr:
        run = subprocess.Popen(
            [*COMMAND, "run", "--case", "4", "--machine", "external", "--no-camera",
             "--namespace", driver.namespace, "--duration-s", "60",
             "--output", str(tmp_path / "run")],
            stderr=stderr,
        )  # fmt: skip
    try:
        until(lambda: "of 60.00 s" in errors.read_text(encoding="utf-8"))
        child_of(run, "cable_fem_node").kill()
        assert run.wait(240.0) == 1
    finally:
        run.kill()
    assert "cable_fem ended with exit code -9" in errors.read_text(encoding="utf-8")
    outcome = numbers(tmp_path / "run")["outcome"]
    assert "cable_fem ended with exit code -9" in outcome["cause"]["text"]
    assert outcome["machine"] == "turning"
    assert failure in outcome["sentences"][0]
