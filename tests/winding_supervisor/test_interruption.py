"""Signals while an event loop runs: what was opened is closed in reverse, whatever comes when."""

import asyncio
import signal
from contextlib import AsyncExitStack
from typing import Any

import pytest

from winding_supervisor.session import interruption
from winding_supervisor.session.interruption import Interruption, run_closing


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
