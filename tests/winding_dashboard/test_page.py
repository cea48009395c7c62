"""The page shows the run, by NiceGUI's simulated user: no browser, the real view state."""

import time

import numpy as np
import pytest
from nicegui import ui
from nicegui.testing import user_simulation
from simulated_page import Machine, fresh_state, phase

from winding_core.markers import CORRECTED_DTYPE, wound_markers
from winding_core.material_report import MaterialReport
from winding_core.readings import CABLE_TENSION, AxisReading
from winding_core.status import Level
from winding_dashboard.views.page import Page

pytestmark = [pytest.mark.asyncio, pytest.mark.slow]


async def test_numbers_of_the_run_are_shown() -> None:
    state = fresh_state()
    phase(state, "winding")
    state.note_axes(
        12.3,
        AxisReading(
            cylinder_angle=20.0, angular_speed=1.74, carriage_position=0.06, feed_speed=0.005
        ),
    )
    state.measured[CABLE_TENSION] = 3.92
    tracked = wound_markers(
        ids=[1], theta=np.array([6.0]), z=[0.01], radius=0.017, cylinder_angle=20.0
    )
    state.note_tracked(12.3, tracked)
    corrected = np.zeros(1, CORRECTED_DTYPE)
    corrected["id"], corrected["s"], corrected["s_low"], corrected["s_high"] = 1, 0.1, 0.09, 0.11
    state.corrected = corrected
    state.note_votes({3: 0.25, 4: 0.75})
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        for text in ("winding", "12.3 s", "1.740", "5.00", "3.92", "100.00", "90.0–110.0"):
            await user.should_see(text)
        await user.should_see("102.49")
        await user.should_see("+2.49 %")
        await user.should_see("75%, 3: 25%")


async def test_changes_are_pushed() -> None:
    state = fresh_state()
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        await user.should_see("nothing heard")
        phase(state, "emergency stop", Level.ERROR)
        await user.should_see("emergency stop", retries=50)
        await user.should_see("ERROR", retries=50)


async def test_material_is_told_with_its_half_width() -> None:
    state = fresh_state()
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        await user.should_see("Effective modulus: no marker is measured yet")
        state.material = MaterialReport(
            law="neo_hookean",
            young=2.61e6,
            standard_error=3.0e4,
            half_width_90=5.2e4,
            markers=(1, 2),
            worst_share=0.01,
            taken_up=False,
        )
        await user.should_see(
            "Effective modulus 2.610 ± 0.052 MPa (nine times in ten), neo hookean, from P1, P2; "
            "the model keeps its own",
            retries=50,
        )


async def test_text_from_the_graph_is_text_and_never_markup() -> None:
    state = fresh_state()
    phase(state, "<b>idle</b>")
    async with user_simulation(lambda: Page(state, Machine(), time.monotonic)) as user:
        await user.open("/")
        shown = user.find("<b>idle</b>").elements
        assert {type(element) for element in shown} == {ui.label}
