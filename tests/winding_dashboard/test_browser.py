"""One whole run clicked through in a real browser, on a real graph of processes."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.slow]

# Ten times what the page takes, on two busy cores.
PATIENCE_MS = 60_000
FULL_SPEED = 1.74
# The encoder's speed scatters by 0.01 rad/s around full speed; a stop leaves it in 20 ms.
SLOWER = 0.97 * FULL_SPEED


@pytest.fixture(scope="module")
def desk(new_tab: Any, operated: Any) -> Any:
    return new_tab("desk", operated.url)


@pytest.fixture
def phone(new_tab: Any, operated: Any) -> Iterator[Any]:
    tab = new_tab("phone", operated.url)
    yield tab
    # A second tab takes what the measurements of the first need.
    tab.page.close()


def slowed_after(operated: Any, clicked: float) -> float:
    """Return how long after a click the encoder's speed left full speed [s]."""
    end = time.monotonic() + PATIENCE_MS / 1000
    while time.monotonic() < end:
        for t, speed in tuple(operated.motion.samples):
            if t > clicked and abs(speed) < SLOWER:
                return float(t - clicked)
        time.sleep(0.05)
    pytest.fail("the cylinder did not slow down")


def full_speed(operated: Any) -> Callable[[], bool]:
    return lambda: operated.motion.samples[-1][1] > SLOWER


def wait(reached: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_MS / 1000
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_idle_machine_can_be_started_and_nothing_else_is_off(desk: Any, pictures: Path) -> None:
    desk.phase("ready")
    for name in ("Start", "Stop", "Reset", "EMERGENCY STOP"):
        desk.can(name)
    desk.page.screenshot(path=pictures / "idle.png")


def test_case_and_law_are_prepared_on_every_node(desk: Any) -> None:
    setup = desk.page.locator(".setup")
    setup.get_by_label("Material law").select_option("neo_hookean")
    setup.get_by_label("Case").select_option("5")
    setup.get_by_role("button", name="Prepare").click()
    desk.wait_for("document.querySelector('#answer').innerText.includes('ready to wind case 5')")
    desk.wait_for(
        "[...document.querySelectorAll('.nodes tbody tr')].slice(0, 4)"
        ".every(row => row.innerText.includes('active'))"
    )


def test_start_makes_numbers_move(desk: Any, operated: Any) -> None:
    desk.button("Start").click()
    desk.phase("winding")
    wait(full_speed(operated))
    desk.wait_for("parseFloat(document.querySelector('.tile .value').innerText) > 1.6")
    first = desk.page.locator(".clock").inner_text()
    desk.wait_for(f"document.querySelector('.clock').innerText !== '{first}'")
    # The lay is that of case 5, whose marker spacing is 100 mm.
    desk.wait_for("document.querySelectorAll('.camera polygon').length > 0")
    desk.wait_for("parseFloat(document.querySelector('#markers td.measured').innerText) > 90")


def test_pictures_fit_the_desk_and_the_phone(
    desk: Any, phone: Any, operated: Any, pictures: Path
) -> None:
    for tab, name in ((desk, "desk"), (phone, "phone")):
        tab.phase("winding")
        tab.wait_for("document.querySelectorAll('.charts .curve').length >= 4")
        tab.shoot(pictures, name)
        assert tab.misfits() == []
    assert phone.complaints == []
    assert phone.strangers(operated.url) == []


def test_every_control_is_reached_by_keyboard(desk: Any) -> None:
    desk.page.locator("body").focus()
    reached = set()
    for _ in range(12):
        desk.page.keyboard.press("Tab")
        reached.add(desk.page.evaluate("document.activeElement.innerText"))
    assert {"Stop", "EMERGENCY STOP"} <= reached


def test_stop_slows_the_cylinder(desk: Any, operated: Any) -> None:
    wait(full_speed(operated))
    after = slowed_after(operated, desk.click_time("Stop"))
    print(f"the cylinder slows {after:.3f} s after the click on Stop")
    desk.phase("stopped")


def test_emergency_stop_slows_the_cylinder(desk: Any, operated: Any) -> None:
    desk.button("Start").click()
    wait(full_speed(operated))
    after = slowed_after(operated, desk.click_time("EMERGENCY STOP"))
    print(f"the cylinder slows {after:.3f} s after EMERGENCY STOP")
    desk.phase("e-stop")


def test_reset_begins_a_new_run_that_can_be_started(desk: Any, operated: Any) -> None:
    desk.wait_for(
        "[...document.querySelectorAll('header button')]"
        ".find(b => b.innerText === 'Start').disabled"
    )
    reset(desk)
    desk.button("Start").click()
    desk.phase("winding")
    wait(full_speed(operated))
    desk.button("Stop").click()
    desk.phase("stopped")


def reset(desk: Any) -> None:
    desk.button("Reset").click()
    desk.answer("Reset")
    desk.phase("ready")
    desk.wait_for("document.querySelector('#answer').innerText.includes('start of a run')")
    desk.can("Start")


def test_nobody_complained_and_nobody_outside_was_asked(desk: Any, operated: Any) -> None:
    assert desk.complaints == []
    assert desk.strangers(operated.url) == []
