"""`winding run --machine external` with a driver that keeps the tutorial's table and no more."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.processes, pytest.mark.timeout(600)]

DURATION = "5"  # P1 of case 4 has landed by then, and P2 has not


@pytest.fixture
def wind(driver: Any, tmp_path: Path, command: Callable[..., Any]) -> Callable[..., Any]:
    """Wind case 4 with the driver; the run's folder is `run`."""

    def run(*further: object, code: int = 0) -> Any:
        return command(
            *("run", "--case", 4, "--machine", "external", "--no-camera"),
            *("--namespace", driver.namespace, "--duration-s", DURATION),
            *("--output", tmp_path / "run", *further),
            cwd=tmp_path, code=code,
        )  # fmt: skip

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
    wind(
        *("--cylinder-joint", "spindle", "--carriage-joint", "slide"),
        *("--cylinder-scale", -1.0, "--carriage-scale", -0.001),
    )
    found = numbers(tmp_path / "run")["markers"][0]["s_fem_m"]
    assert found == pytest.approx(predicted_p1, rel=SAME)


@pytest.mark.parametrize("driver", [{"[self.angle, self": "[-self.angle, self"}], indirect=True)
def test_a_reversed_axis_is_named_and_what_was_wound_is_kept(wind: Any, tmp_path: Path) -> None:
    done = wind(code=1)
    assert "the cylinder turned backwards" in done.stderr
    assert "the cylinder turned backwards" in numbers(tmp_path / "run")["ended"]
    page = (tmp_path / "run" / "report" / "index.html").read_text(encoding="utf-8")
    assert "ended by the machine after" in page
