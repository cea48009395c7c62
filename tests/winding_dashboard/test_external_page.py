"""The page of a machine of one's own."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from attended_run import AttendedRun, attended_run

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.slow]

# Of the run [%]: less than the correction leaves of case 4.
LIMIT = 0.2


@pytest.fixture
def run(driver: Any, serving: Any, tmp_path: Path) -> Iterator[AttendedRun]:
    options = ("--machine", "external", "--no-camera", "--namespace", driver.namespace)
    with attended_run(serving, tmp_path / "run", *options, "--duration-s", "5") as attended:
        yield attended


def test_a_machine_of_ones_own_is_conducted_from_the_page(
    run: AttendedRun, new_tab: Any, pictures: Path
) -> None:
    desk = new_tab("desk", run.url)
    desk.phase("ready")
    desk.page.get_by_label("Error of a length, %").fill(str(LIMIT))
    desk.page.get_by_role("button", name="Set", exact=True).click()
    desk.said(f"limits: {LIMIT} %")
    desk.can("Start")
    desk.button("Start").click()
    desk.phase("winding")
    desk.wait_for("document.querySelectorAll('#runs a').length === 1")
    desk.shoot(pictures, "external-over")
    assert desk.misfits() == []
    with desk.page.expect_popup() as opened:
        desk.page.locator("#runs a").first.click()
    opened.value.get_by_text("largest error").first.wait_for()
    record = json.loads((run.folder / "run.json").read_text(encoding="utf-8"))
    assert record["ended"] is None
    assert record["error_verdict"]["limit_pct"] == LIMIT
    assert desk.complaints == []
    code, said = run.end()
    assert code == 0, said
