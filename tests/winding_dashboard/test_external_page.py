"""The page of a machine of one's own: run after run, each with its report."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from attended_run import AttendedRun, attended_run

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.slow]

# Of a length [%]: less than the correction leaves of case 4.
LIMIT = 0.2
RUNS = "document.querySelectorAll('#runs a').length"


@pytest.fixture
def run(driver: Any, serving: Any, tmp_path: Path) -> Iterator[AttendedRun]:
    options = ("--machine", "external", "--no-camera", "--namespace", driver.namespace)
    with attended_run(serving, tmp_path / "run", *options, "--duration-s", "5") as attended:
        yield attended


def set_limit(desk: Any) -> None:
    desk.page.get_by_label("Error of a length, %").fill(str(LIMIT))
    desk.page.get_by_role("button", name="Set", exact=True).click()
    desk.answered(f"limits: {LIMIT} %")


def start(desk: Any) -> None:
    desk.phase("ready")
    desk.can("Start")
    desk.button("Start").click()
    desk.phase("winding")


def reset(desk: Any) -> None:
    desk.can("Reset")
    desk.button("Reset").click()
    desk.answer("Reset")
    desk.answered("made ready for the next run")


def records(folder: Path) -> list[Any]:
    """Return the numbers of every run, the first one first."""
    files = [folder / "run.json", folder / "run-2" / "run.json", folder / "run-3" / "run.json"]
    return [json.loads(file.read_text(encoding="utf-8")) for file in files if file.exists()]


def test_a_machine_of_ones_own_winds_run_after_run_from_the_page(
    run: AttendedRun, new_tab: Any, pictures: Path
) -> None:
    desk = new_tab("desk", run.url)
    start(desk)
    desk.wait_for(f"{RUNS} === 1")
    desk.phase("stopped")
    assert desk.button("Start").is_disabled()
    desk.page.get_by_text("the run is over; reset makes the machine ready").wait_for()
    assert float(desk.page.locator("#clock").inner_text().removesuffix(" s")) < 60.0
    desk.shoot(pictures, "external-over")
    assert desk.misfits() == []
    set_limit(desk)
    # The encoders go on counting: the second run begins where they stand.
    reset(desk)
    start(desk)
    desk.wait_for("parseFloat(document.querySelector('#clock').textContent) > 1.0")
    desk.button("EMERGENCY STOP").click()
    desk.phase("stopped")
    # A run that is broken off is over as soon as the operator wants the next one.
    reset(desk)
    desk.wait_for(f"{RUNS} === 2")
    start(desk)
    desk.wait_for(f"{RUNS} === 3")
    desk.shoot(pictures, "external-three-runs")
    code, output = run.end()
    assert code == 0, output
    whole, broken, again = records(run.folder)
    assert [item["error_verdict"]["limit_pct"] for item in (whole, broken, again)] == [
        4.8, LIMIT, LIMIT,
    ]  # fmt: skip
    assert [item["ended"] for item in (whole, broken, again)] == [
        None, "reset by the operator", None,
    ]  # fmt: skip
    # The driver winds the same programme, from other places of its encoders.
    lengths = [item["markers"][0]["s_fem_m"] for item in (whole, again)]
    assert lengths[1] == pytest.approx(lengths[0], rel=1.0e-3)
    assert len({item["identity"]["run_id"] for item in (whole, broken, again)}) == 3
    assert desk.complaints == []
