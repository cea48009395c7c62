"""Wind one run after the other with the real graph for some minutes; a process of its own.

It prints `winding` when the machine winds for the first time, and then one line for
every run that was begun and for every one that supervision ended.
"""

import asyncio
import os
import sys
import time
from pathlib import Path

from cell import Cell
from winding_ros.environment import set_process_environment
from winding_supervisor.session.domain_lock import domain_lock

NAMESPACE = "soak"
# Simulated time after which the cell begins a new run by itself [s].
RUN = 20.0


async def wind(folder: Path, minutes: float) -> None:
    cell = Cell(folder / "cell", NAMESPACE)
    async with cell.running():
        await cell.winding()
        print("winding", flush=True)
        end = time.monotonic() + 60.0 * minutes
        while time.monotonic() < end:
            await cell.winding()
            begun = cell.t
            print(f"a run at {begun:.1f} s", flush=True)
            await cell.until(
                lambda begun=begun: cell.t > begun + RUN or not cell.goes_on(), "a run"
            )
            if not cell.goes_on():
                # A machine that is too busy ends runs, and the cell begins another.
                print(f"ended: {await cell.end_of_run()}", flush=True)


if __name__ == "__main__":
    place = Path(sys.argv[1])
    domain = int(os.environ["ROS_DOMAIN_ID"])
    set_process_environment(domain, place / "log")
    with domain_lock(domain, NAMESPACE):
        asyncio.run(wind(place, float(sys.argv[2])))
