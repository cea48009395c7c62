"""Serve the page of a made-up controlled run, without ROS; its graph carries out what is asked.

python controlled_page.py PORT serves the page until it is ended; the commands it gets are printed.
With `standing` before PORT the machine stands, and another condition can be prepared.
"""

import asyncio
import math
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import numpy as np
from simulated_page import Machine, fresh_state, phase, served, wound

from winding_core.cable.condition import Condition
from winding_core.lay.records import LAY_CONTROL_DTYPE, LAY_DTYPE, ControlMode, LayRecords
from winding_core.machine.readings import AxisReading
from winding_core.markers import CABLE_DTYPE, Markers, wound_markers
from winding_core.status import Status
from winding_dashboard.page import commands
from winding_dashboard.page.templates import Templates
from winding_dashboard.state.view_state import ViewState
from winding_dashboard.web.listening import listen
from winding_dashboard.web.server import application

RADIUS = 0.017
SPEED = 1.74
ADVANCE = 2.87e-3
GUIDE_AHEAD = 0.033
LAG = 0.2 / RADIUS
# As of a drum with a gap in its second layer.
LAYERS = Status(
    name="lay_control",
    values={"layer_turns": "[0.0, 2.0, 4.0, 900.0]", "layer_faults": '[{"theta": 20.0}]'},
)
MARKERS_APART, PERIOD = 4.65, 0.1


def off_by(theta: np.ndarray) -> np.ndarray:
    """Return measured less wanted z [m]: what is missing in the first turn, and a fault in one."""
    fault = np.where(np.floor(theta / math.tau) == 3, 0.7e-3 * np.sin(theta) ** 2, 0.0)
    return -1.4e-3 * np.exp(-theta) + fault + 3.0e-5 * np.sin(7.0 * theta)


def measured_lay(theta: float) -> LayRecords:
    """Return what the tracker reports of every turn behind a wound angle [rad]."""
    at = np.radians(np.arange(2.5, math.degrees(theta), 5.0))
    lay = np.zeros(at.size, LAY_DTYPE)
    lay["theta"], lay["turn"] = at, at // math.tau
    lay["x"], lay["y"] = RADIUS * np.cos(theta - at), RADIUS * np.sin(theta - at)
    lay["z"], lay["sigma_z"] = ADVANCE * at + off_by(at), 1.0e-4
    return lay


def markers(theta: float) -> Markers:
    """Return P0 and the markers behind a wound angle [rad], 79 mm of cable apart."""
    at = np.arange(0.0, theta, MARKERS_APART)[:5]
    return wound_markers(
        ids=range(at.size), theta=at, z=ADVANCE * at, radius=RADIUS, cylinder_angle=theta
    )


def note_run(state: ViewState, theta: float, mode: ControlMode, *, step: float = 0.1) -> None:
    """Give a state what the graph reports of a run up to a wound angle [rad]."""
    before = 0.0 if state.control.newest is None else float(state.control.newest["theta"])
    for angle in np.append(np.arange(before, theta, step), theta):
        record = np.zeros(1, LAY_CONTROL_DTYPE)
        record["mode"] = mode
        record["theta"] = angle
        record["z"], record["sigma_z"] = ADVANCE * angle, 1.0e-4
        record["wanted_z"] = ADVANCE * angle
        record["pull"] = math.nan
        record["guide"] = ADVANCE * angle + GUIDE_AHEAD
        record["free_length"], record["sigma_free_length"] = 0.1958, 0.0055
        record["load_share"], record["sigma_load_share"] = 0.881, 0.079
        state.control.note(angle / SPEED, record)
    t = theta / SPEED
    state.note_axes(
        t,
        AxisReading(
            cylinder_angle=theta,
            angular_speed=SPEED,
            carriage_position=ADVANCE * theta + GUIDE_AHEAD,
            feed_speed=ADVANCE * SPEED,
        ),
    )
    state.note_source("lay", t, measured_lay(theta))
    state.note_source("predicted", t, markers(theta))
    state.note_source("tracked", t, markers(theta))
    at = np.arange(0.0, theta, 0.3)
    cable = np.zeros(at.size, CABLE_DTYPE)
    cable["x"], cable["y"] = RADIUS * np.cos(theta - at), RADIUS * np.sin(theta - at)
    cable["z"] = ADVANCE * at + 0.4e-3 * -np.expm1(-at / LAG)
    state.note_source("cable", t, cable)


class Controlled(Machine):
    """A graph that switches the controller of the lay in its state."""

    def __init__(self, state: ViewState, **kwargs: str) -> None:
        super().__init__(**kwargs)
        self.state = state
        self.mode = ControlMode.DRIVE

    async def command(self, command: str) -> str:
        answer = await super().command(command)
        for mode, name in commands.LAY_CONTROL.items():
            if name == command:
                self.mode = mode
        print(f"asked {command}", flush=True)
        return answer

    async def record(self, on: bool) -> str:
        """Never come to an end, as a recorder whose disk hangs."""
        await asyncio.Event().wait()
        return ""


def main(port: int, *, standing: bool) -> None:
    state = fresh_state()
    graph = Controlled(state)
    begin = time.monotonic()
    page = served(state, graph, clock=time.monotonic)

    async def stand() -> None:
        while True:
            phase(state, "idle", now=time.monotonic())
            await page.session.learn_choice()
            await asyncio.sleep(PERIOD)

    async def wind() -> None:
        while True:
            phase(state, "winding", now=time.monotonic())
            wound(state, Condition(duration=60.0), now=time.monotonic())
            state.control.note_statuses([LAYERS])
            note_run(state, 30.0 + 0.2 * (time.monotonic() - begin), graph.mode)
            state.tick(time.monotonic())
            await asyncio.sleep(PERIOD)

    @asynccontextmanager
    async def lifespan(_: object) -> AsyncIterator[None]:
        winding = asyncio.create_task(stand() if standing else wind())
        yield
        winding.cancel()

    app = application(page, Templates().page(), token="", host="127.0.0.1", lifespan=lifespan)
    listen(app, "127.0.0.1", port)


if __name__ == "__main__":
    main(int(sys.argv[-1]), standing="standing" in sys.argv)
