"""Ten runs in a row from one page of `winding run --dashboard`, three stopped on purpose."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from attended_run import NAMESPACE, AttendedRun, attended_run

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(1800)]

RUNS, STOPPED = 10, (3, 6, 8)
LIMIT = 0.2  # Of the last run [%]: less than the correction leaves of case 4
# Allocators keep some of a report's pictures; a run that stayed in memory would be 10 MB and more.
GROWTH_MB = 60.0
ROWS = "document.querySelectorAll('#runs tbody th').length"


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AttendedRun]:
    folder = tmp_path_factory.mktemp("session") / "runs"
    options = ("--namespace", NAMESPACE, "--duration-s", "5")
    with attended_run(folder, *options) as attended:
        yield attended


def test_ten_runs_leave_ten_reports_a_live_page_and_flat_memory(
    session: AttendedRun, new_tab: Any, pictures: Path
) -> None:
    desk = new_tab("desk", session.url)
    held = []
    for run in range(1, RUNS + 1):
        desk.phase("ready")
        desk.can("Start")
        desk.button("Start").click()
        desk.phase("winding")
        if run == RUNS:
            desk.page.get_by_label("Error of a length, %").fill(str(LIMIT))
            desk.page.get_by_role("button", name="Set", exact=True).click()
            desk.answered("limits: ")
        if run in STOPPED:
            desk.wait_for("parseFloat(byId('clock').textContent) % 1000 > 0.5")
            desk.button("EMERGENCY STOP").click()
            desk.phase("e-stop")
        else:
            desk.phase("finished")
        desk.wait_for(f"{ROWS} === {run}")
        desk.wait_for("document.querySelectorAll('#runs a').length === " + str(run))
        if run in (1, RUNS):
            desk.shoot(pictures, f"after-run-{run}")
        desk.button("Reset").click()
        desk.answer("Reset")
        desk.answered("start of a run")
        held.append(session.memory_mb())
    print("MB after each run:", [round(value) for value in held])
    assert desk.complaints == []
    assert held[-1] - held[2] < GROWTH_MB
    folders = [session.folder / ("" if n == 1 else f"run-{n}") for n in range(1, RUNS + 1)]
    numbers = [folder / "run.json" for folder in folders]
    for n, file in enumerate(numbers, start=1):
        record = json.loads(file.read_text(encoding="utf-8"))
        assert (record["ended"] == "emergency stop") == (n in STOPPED), (n, record["ended"])
        assert (file.parent / "report" / "index.html").is_file()
    last = json.loads(numbers[-1].read_text(encoding="utf-8"))["error_verdict"]
    assert (last["good"], last["limit_pct"]) == (False, LIMIT)
    identities = {json.loads(f.read_text(encoding="utf-8"))["identity"]["run_id"] for f in numbers}
    assert len(identities) == RUNS


def test_report_opens_from_the_page(session: AttendedRun, new_tab: Any) -> None:
    desk = new_tab("desk", session.url)
    desk.wait_for(f"{ROWS} === {RUNS}")
    with desk.page.expect_popup() as opened:
        desk.page.locator("#runs a").first.click()
    opened.value.get_by_text("largest error").first.wait_for()


# The runs are those that the page's test has wound.
@pytest.mark.usefixtures("browser")
def test_ctrl_c_ends_the_session_without_a_failure(session: AttendedRun) -> None:
    code, output = session.end()
    assert code == 0, output
    assert output.count("Curve lengths of case 4") == RUNS
