"""How a run and its machine are stopped: signals, closing in reverse, a late quick stop."""

import asyncio
import signal
from contextlib import AsyncExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from processes import python
from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import DriveProfile
from winding_supervisor.machines.external_machine import ExternalMachine, ExternalMachineConfig
from winding_supervisor.session import interruption
from winding_supervisor.session.interruption import Interruption, run_closing

QUICK_STOP, STOP = "rig/quick_stop", "rig/stop"


@pytest.fixture(autouse=True)
def childless(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the second signal from the children of the process that runs the tests."""

    class Childless:
        def children(self, *, recursive: bool) -> list[Any]:
            return []

    monkeypatch.setattr(interruption.psutil, "Process", Childless)


@pytest.fixture
def closed() -> list[str]:
    """What the closers of a test have noted."""
    return []


async def forever() -> None:
    await asyncio.get_running_loop().create_future()


def test_result_comes_after_everything_is_closed_in_reverse(closed: list[str]) -> None:
    async def work(stack: AsyncExitStack, _: Interruption) -> str:
        for name in ("first", "second"):
            stack.callback(closed.append, name)
        return "result"

    assert run_closing(work) == "result"
    assert closed == ["second", "first"]


def test_error_of_the_work_is_raised_after_closing(closed: list[str]) -> None:
    async def work(stack: AsyncExitStack, _: Interruption) -> None:
        stack.callback(closed.append, "closed")
        raise ValueError("why")

    with pytest.raises(ValueError, match="why"):
        run_closing(work)
    assert closed == ["closed"]


def test_signal_cancels_the_work_and_no_closer(closed: list[str]) -> None:
    async def close() -> None:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGTERM):
            signal.raise_signal(number)
            await asyncio.sleep(0)
        closed.append("closed")

    async def work(stack: AsyncExitStack, _: Interruption) -> None:
        stack.push_async_callback(close)
        asyncio.get_running_loop().call_soon(signal.raise_signal, signal.SIGTERM)
        await forever()

    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt):
        run_closing(work)
    assert closed == ["closed"]
    assert signal.getsignal(signal.SIGTERM) is before


def test_signal_after_the_work_still_interrupts() -> None:
    async def work(stack: AsyncExitStack, _: Interruption) -> str:
        stack.callback(signal.raise_signal, signal.SIGTERM)
        return "result"

    with pytest.raises(KeyboardInterrupt):
        run_closing(work)


def test_second_signal_ends_a_closer_that_waits_and_the_next_one_runs(closed: list[str]) -> None:
    async def wait() -> None:
        signal.raise_signal(signal.SIGTERM)
        await forever()

    async def work(stack: AsyncExitStack, interrupted: Interruption) -> None:
        stack.callback(closed.append, "killed")
        stack.push_async_callback(interrupted.unless_hastened, wait)
        signal.raise_signal(signal.SIGTERM)
        await forever()

    with pytest.raises(KeyboardInterrupt):
        run_closing(work)
    assert closed == ["killed"]


def test_sigint_may_stand_for_the_orderly_end_once() -> None:
    async def work(_: AsyncExitStack, interrupted: Interruption) -> str:
        ended = asyncio.Event()
        interrupted.instead_of_sigint(ended.set)
        signal.raise_signal(signal.SIGINT)
        await ended.wait()
        return "ended by the operator"

    assert run_closing(work) == "ended by the operator"


class Driver:
    """Answers services when a test lets it; `heard` has their names in order."""

    def __init__(self) -> None:
        self.heard: list[str] = []
        self.answers = {name: asyncio.Event() for name in (QUICK_STOP, STOP)}
        self.node = SimpleNamespace(resolve_service_name=lambda name: name)

    def ready(self, _: type, name: str) -> bool:
        return True

    async def call(self, _: type, name: str, request: Any, timeout: float, *, retry: bool) -> Any:
        self.heard.append(name)
        async with asyncio.timeout(timeout):
            await self.answers[name].wait()
        return SimpleNamespace(success=True, message="")

    async def hears(self, name: str) -> None:
        while name not in self.heard:
            await asyncio.sleep(0.0)


def machine(driver: Driver) -> ExternalMachine:
    config = ExternalMachineConfig(
        axes=MachineAxes(),
        drive=DriveProfile(),
        end_angle=1.0,
        camera=False,
        starts_itself=False,
        standing_limit=60.0,
    )
    return ExternalMachine(config, cast(Any, driver), cast(Any, None))


@pytest.mark.asyncio
@pytest.mark.parametrize("answered", [QUICK_STOP, STOP])
async def test_either_answer_is_a_stop_when_the_first_is_late(answered: str) -> None:
    driver = Driver()
    stopping = asyncio.create_task(machine(driver).quick_stop())
    await driver.hears(STOP)
    driver.answers[answered].set()
    assert await stopping == ""
    assert driver.heard == [QUICK_STOP, STOP]


@pytest.mark.asyncio
async def test_a_quick_stop_that_is_answered_at_once_is_the_only_one() -> None:
    driver = Driver()
    driver.answers[QUICK_STOP].set()
    assert await machine(driver).quick_stop() == ""
    assert driver.heard == [QUICK_STOP]


@pytest.mark.asyncio
async def test_two_services_that_hang_are_named() -> None:
    assert await machine(Driver()).quick_stop() == (
        "the stop could not be delivered: no answer from rig/quick_stop in 0.8 s; "
        "no answer from rig/stop in 0.8 s"
    )


@pytest.mark.slow
def test_closing_that_hangs_with_the_interpreter_lock_held_ends_the_process(tmp_path: Path) -> None:
    # A call into C through PyDLL keeps the lock, as the middleware's deadlock did.
    program = """
import ctypes, sys
from pathlib import Path
from winding_supervisor.session.interruption import ended_if_stuck
with ended_if_stuck(1.5, Path(sys.argv[1])):
    ctypes.PyDLL(None).pause()
"""
    file = tmp_path / "closing.txt"
    assert python(program, file, timeout=120).returncode == 1
    assert "Timeout" in file.read_text(encoding="utf-8")


def test_closing_in_time_leaves_nothing(tmp_path: Path) -> None:
    with interruption.ended_if_stuck(60.0, tmp_path / "closing.txt"):
        assert (tmp_path / "closing.txt").exists()
    assert list(tmp_path.iterdir()) == []
