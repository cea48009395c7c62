"""The driver ends whenever it is cancelled, also while an answer of the PLC comes in."""

import asyncio
import time
from typing import Any

import pytest
import yaml

from winding_core.machine.joining import Sample
from winding_core.status import Status
from winding_plc_driver.driver import Driver
from winding_plc_driver.machine.mapping import parse_mapping
from winding_plc_driver.machine.pacing import Measured
from winding_plc_driver.opcua.session import Session

pytestmark = [pytest.mark.processes, pytest.mark.slow]


class Nowhere:
    """Takes what the driver publishes."""

    def joints(self, sample: Sample) -> None: ...
    def measured(self, stamp_ns: int, measured: Measured) -> None: ...
    def status(self, status: Status) -> None: ...
    def log(self, text: str) -> None: ...


@pytest.mark.asyncio
async def test_a_cancellation_is_never_lost(machine: Any, examples: Any) -> None:
    """With asyncio.wait_for around the requests, one of the first five was."""
    content = yaml.safe_load((examples / "opcua_machine.yaml").read_text(encoding="utf-8"))
    content["server"]["endpoint"] = f"opc.tcp://127.0.0.1:{machine().port}"
    # Answers that come all the time.
    content["server"]["publishing_interval_s"] = 0.01
    mapping = parse_mapping(yaml.safe_dump(content), examples)
    for k in range(20):
        driver = Driver(mapping, Session(mapping, ""), time.monotonic, time.time)
        await driver.contact()
        task = asyncio.create_task(driver.run(Nowhere()))
        await asyncio.sleep(0.1 + 0.0071 * k)
        task.cancel()
        await asyncio.wait([task], timeout=60.0)
        assert task.cancelled()
