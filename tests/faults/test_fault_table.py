"""The fault table on real processes: each fault is survived as it has to be.

What happens is judged, not when: `winding faults` tries these rows and more, and measures seconds,
which it judges only where the computer had time.
"""

import asyncio
import io
import os
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from winding_cli.app import app
from winding_ros.environment import set_process_environment
from winding_supervisor.session.domain_lock import domain_lock
from winding_verification.faults import campaign
from winding_verification.faults.campaign import LONE_ROWS, NAMESPACE, ROWS, row_names
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.cell_faults import SENSOR_FAULTS
from winding_verification.faults.outcome import Outcome

# The command tries these too; here other tests stand for them.
ONLY_IN_THE_COMMAND = {
    "stuck load cell",
    "tension out of range",
    "rig/tension out of range",
    "garbage on camera/camera_info",
    "silent rig/tension",
    "speed over limit",
    "SIGSTOP orchestrator",
}
LATE = {"fault": "late", "outcome": "the run went on", "detected_after": 2.0, "detect_within": 1.0}


def on_real_processes(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that tries rows of the table on a graph."""
    for mark in (pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(600)):
        test = mark(test)
    return test


@pytest.fixture(scope="module")
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    loop = asyncio.new_event_loop()
    yield loop
    loop.close()


@pytest.fixture(scope="module")
def cell(
    loop: asyncio.AbstractEventLoop, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[FaultCell]:
    folder = tmp_path_factory.mktemp("faults")
    domain = int(os.environ["ROS_DOMAIN_ID"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RCUTILS_CONSOLE_OUTPUT_FORMAT", "")
        patch.setenv("ROS_LOG_DIR", os.environ["ROS_LOG_DIR"])
        set_process_environment(domain, folder / "log")
        with domain_lock(domain, NAMESPACE):
            cell = FaultCell(folder / "cell", NAMESPACE, unhurried=True)
            running = cell.running()
            try:
                yield loop.run_until_complete(running.__aenter__())
            finally:
                loop.run_until_complete(running.__aexit__(None, None, None))


def check(loop: asyncio.AbstractEventLoop, trial: Awaitable[Outcome]) -> None:
    outcome = loop.run_until_complete(asyncio.wait_for(trial, 240.0))
    print(outcome)
    assert outcome.survived, outcome


@on_real_processes
@pytest.mark.parametrize("name", [name for name in ROWS if name not in ONLY_IN_THE_COMMAND])
def test_fault_is_survived(loop: asyncio.AbstractEventLoop, cell: FaultCell, name: str) -> None:
    check(loop, ROWS[name](cell))


@on_real_processes
def test_no_process_shares_memory_whose_lock_a_killed_one_could_hold(cell: FaultCell) -> None:
    nodes = cell.orchestrator.pids()
    assert nodes
    for pid in (os.getpid(), *nodes.values()):
        assert "/dev/shm/fastrtps" not in Path(f"/proc/{pid}/maps").read_text()


@on_real_processes
@pytest.mark.usefixtures("cell")
@pytest.mark.parametrize("name", [name for name in LONE_ROWS if name not in ONLY_IN_THE_COMMAND])
def test_loss_of_the_orchestrator_is_survived(
    loop: asyncio.AbstractEventLoop, name: str, tmp_path: Path
) -> None:
    check(loop, LONE_ROWS[name](tmp_path / "run"))


def test_every_excluded_row_is_one_of_the_table() -> None:
    assert set(row_names()) >= ONLY_IN_THE_COMMAND


def printed(*outcomes: Outcome) -> str:
    console = Console(file=io.StringIO(), width=200)
    campaign.show(list(outcomes), console)
    return " ".join(console.file.getvalue().split())


def test_a_row_that_the_table_does_not_have_is_refused() -> None:
    result = CliRunner().invoke(app, ["faults", "--only", "earthquake"])
    assert result.exit_code == 2
    assert result.stderr == "winding: no row of the fault table contains 'earthquake'\n"


def test_rows_have_names_of_their_own() -> None:
    assert len(set(campaign.row_names())) == len(campaign.row_names()) > 20
    assert all(fault.noticed and fault.within > 0.0 for fault in SENSOR_FAULTS)
    assert len(SENSOR_FAULTS) == 14


def test_seconds_are_judged_where_the_computer_had_time() -> None:
    outcome = Outcome(survived=True, **LATE)
    assert not outcome.passed
    assert "too late" in printed(outcome)
    assert "was not saturated" in printed(outcome)


@pytest.mark.parametrize("busy", [{"load": 1.5}, {"idle": 0.01}])
def test_seconds_of_a_saturated_computer_are_printed_and_not_judged(busy: dict[str, float]) -> None:
    outcome = Outcome(survived=True, **LATE, **busy)
    assert outcome.passed
    assert "2.000 1" in printed(outcome).replace("│ ", "")
    assert "saturated during 1 of them" in printed(outcome)


def test_a_fault_that_is_not_survived_fails_on_any_computer() -> None:
    assert not Outcome(survived=False, load=9.0, **LATE).passed
