"""The fault table on real processes: each fault is survived as it has to be.

What happens is judged, not when: `winding faults` tries these rows and more, and measures seconds.
"""

import asyncio
import os
from collections.abc import Awaitable, Iterator
from pathlib import Path

import pytest

from winding_ros.environment import set_process_environment
from winding_supervisor.domain_lock import domain_lock
from winding_verification.faults.campaign import LONE_ROWS, NAMESPACE, ROWS, row_names
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.outcome import Outcome

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.processes,
    pytest.mark.timeout(600),
]

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


class Bench:
    """The cell and the loop that runs it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._loop = asyncio.new_event_loop()
        self._running = self.cell = None

    def enter(self) -> None:
        async def enter() -> None:
            self.cell = FaultCell(self.folder / "cell", NAMESPACE, unhurried=True)
            self._running = self.cell.running()
            await self._running.__aenter__()

        self._loop.run_until_complete(enter())

    def leave(self) -> None:
        if self._running is not None:
            self._loop.run_until_complete(self._running.__aexit__(None, None, None))
        self._loop.close()

    def outcome(self, trial: Awaitable[Outcome]) -> Outcome:
        return self._loop.run_until_complete(asyncio.wait_for(trial, 240.0))


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("faults")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RCUTILS_CONSOLE_OUTPUT_FORMAT", "")
        patch.setenv("ROS_LOG_DIR", os.environ["ROS_LOG_DIR"])
        set_process_environment(int(os.environ["ROS_DOMAIN_ID"]), folder / "log")
        table = Bench(folder)
        with domain_lock(int(os.environ["ROS_DOMAIN_ID"]), NAMESPACE):
            try:
                table.enter()
                yield table
            finally:
                table.leave()


def check(outcome: Outcome) -> None:
    print(outcome)
    assert outcome.survived, outcome


@pytest.mark.parametrize(
    "row", [row for row in ROWS if row.name not in ONLY_IN_THE_COMMAND], ids=lambda row: row.name
)
def test_fault_is_survived(bench: Bench, row: object, tmp_path: Path) -> None:
    check(bench.outcome(row.try_it(bench.cell, tmp_path)))


def test_no_process_shares_memory_whose_lock_a_killed_one_could_hold(bench: Bench) -> None:
    nodes = bench.cell.orchestrator.pids()
    assert nodes
    for pid in (os.getpid(), *nodes.values()):
        assert "/dev/shm/fastrtps" not in Path(f"/proc/{pid}/maps").read_text()


@pytest.mark.parametrize(
    "row",
    [row for row in LONE_ROWS if row.name not in ONLY_IN_THE_COMMAND],
    ids=lambda row: row.name,
)
def test_loss_of_the_orchestrator_is_survived(bench: Bench, row: object, tmp_path: Path) -> None:
    check(bench.outcome(row.try_it(tmp_path / "run")))


def test_every_excluded_row_is_one_of_the_table() -> None:
    assert set(row_names()) >= ONLY_IN_THE_COMMAND
