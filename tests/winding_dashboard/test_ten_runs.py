"""Ten runs in a row from one page of `winding run --dashboard`, three stopped on purpose."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.processes,
    pytest.mark.slow,
    pytest.mark.timeout(1800),
]

PATIENCE = 240.0
RUNS, STOPPED = 10, (3, 6, 8)
# Of the last run [%]: less than the correction leaves of case 4.
LIMIT = 0.2
# Allocators keep some of a report's pictures; a run that stayed in memory would be 10 MB and more.
GROWTH_MB = 60.0
ROWS = "document.querySelectorAll('#runs tbody th').length"


@dataclass(frozen=True, kw_only=True)
class Session:
    """The command, its folder and its page."""

    url: str
    folder: Path
    process: "subprocess.Popen[str]"

    def memory_mb(self) -> float:
        """Return what the command and its page hold [MB]."""
        command = psutil.Process(self.process.pid)
        pages = [c for c in command.children() if "winding_dashboard" in " ".join(c.cmdline())]
        return sum(item.memory_info().rss for item in (command, *pages)) / 1e6


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory, serving: Any) -> Iterator[Session]:
    folder = tmp_path_factory.mktemp("session") / "runs"
    port = serving.free_port()
    process = subprocess.Popen(
        [sys.executable, "-m", "winding_cli.cli", "run", "--case", "4", "--dashboard",
         "--dashboard-port", str(port), "--namespace", "attended", "--output", str(folder),
         "--duration-s", "5"],
        stdout=subprocess.PIPE, text=True, env=serving.environment(),
    )  # fmt: skip
    try:
        serving.wait_for_line(process, "operator's page: http://127.0.0.1:", 500.0)
        yield Session(url=f"http://127.0.0.1:{port}/", folder=folder, process=process)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE)


def test_ten_runs_leave_ten_reports_a_live_page_and_flat_memory(
    session: Session, new_tab: Any, pictures: Path
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
            desk.said("limits: ")
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
        desk.said("start of a run")
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


def test_report_opens_from_the_page(session: Session, new_tab: Any) -> None:
    desk = new_tab("desk", session.url)
    desk.wait_for(f"{ROWS} === {RUNS}")
    with desk.page.expect_popup() as opened:
        desk.page.locator("#runs a").first.click()
    opened.value.get_by_text("largest error").first.wait_for()


def test_ctrl_c_ends_the_session_without_a_failure(session: Session) -> None:
    session.process.send_signal(signal.SIGINT)
    said, _ = session.process.communicate(timeout=PATIENCE)
    assert session.process.returncode == 0, said
    assert said.count("Curve lengths of case 4") == RUNS
