"""The fault table on real processes: each fault is survived as it has to be.

What happens is judged, not when: `winding faults` tries these rows and more, and measures seconds.
"""

import asyncio
import os
from collections.abc import Awaitable, Iterator
from pathlib import Path

import pytest

from winding_ros.environment import set_process_environment
from winding_supervisor.session.domain_lock import domain_lock
from winding_verification.faults.campaign import LONE_ROWS, NAMESPACE, ROWS, row_names
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.outcome import Outcome

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(600)]

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


@pytest.mark.parametrize("name", [name for name in ROWS if name not in ONLY_IN_THE_COMMAND])
def test_fault_is_survived(loop: asyncio.AbstractEventLoop, cell: FaultCell, name: str) -> None:
    check(loop, ROWS[name](cell))


def test_no_process_shares_memory_whose_lock_a_killed_one_could_hold(cell: FaultCell) -> None:
    nodes = cell.orchestrator.pids()
    assert nodes
    for pid in (os.getpid(), *nodes.values()):
        assert "/dev/shm/fastrtps" not in Path(f"/proc/{pid}/maps").read_text()


@pytest.mark.usefixtures("cell")
@pytest.mark.parametrize("name", [name for name in LONE_ROWS if name not in ONLY_IN_THE_COMMAND])
def test_loss_of_the_orchestrator_is_survived(
    loop: asyncio.AbstractEventLoop, name: str, tmp_path: Path
) -> None:
    check(loop, LONE_ROWS[name](tmp_path / "run"))


def test_every_excluded_row_is_one_of_the_table() -> None:
    assert set(row_names()) >= ONLY_IN_THE_COMMAND
