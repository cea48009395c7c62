"""How a real machine is stopped: the second service is asked when the first is late."""

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import DriveProfile
from winding_supervisor.machines.external_machine import ExternalMachine, ExternalMachineConfig

QUICK_STOP, STOP = "rig/quick_stop", "rig/stop"


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
