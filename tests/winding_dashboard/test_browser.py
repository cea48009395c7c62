"""One whole run clicked through in a real browser, on a real graph of processes."""

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.processes, pytest.mark.slow, pytest.mark.xdist_group("processes")]

DESK, PHONE = (1280, 800), (390, 844)
# Ten times what the page takes, on two busy cores.
PATIENCE_MS = 60_000
FULL_SPEED = 1.74
# The operator's stop has to act within 0.3 s of the click.
STOP_ACTS_WITHIN = 0.3
# Other work on the machine only ever makes a stop later: the quickest of a few is the page's own.
TRIES = 4
# The encoder's speed scatters by 0.01 rad/s around full speed; a stop leaves it in 20 ms.
SLOWER = 0.97 * FULL_SPEED


class Tab:
    """A page with what it complained about and whom it asked."""

    def __init__(self, browser: Any, size: tuple[int, int]) -> None:
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.page.set_default_timeout(PATIENCE_MS)
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._note)
        self.page.on("request", lambda request: self.asked.append(request.url))

    def _note(self, message: Any) -> None:
        if message.type == "error":
            self.complaints.append(message.text)

    def button(self, name: str) -> Any:
        return self.page.locator("header").get_by_role("button", name=name, exact=True)

    def wait_for(self, script: str) -> None:
        self.page.wait_for_function(script)

    def phase(self, text: str) -> None:
        self.wait_for(f"document.querySelector('.phase').innerText.toLowerCase() === '{text}'")


@pytest.fixture(scope="module")
def desk(browser: Any, operated: Any) -> Iterator[Tab]:
    tab = Tab(browser, DESK)
    tab.page.goto(operated.url)
    yield tab
    tab.page.close()


@pytest.fixture
def phone(browser: Any, operated: Any) -> Iterator[Tab]:
    tab = Tab(browser, PHONE)
    tab.page.goto(operated.url)
    yield tab
    tab.page.close()


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pictures")


def slowed_after(operated: Any, clicked: float) -> float:
    """Return how long after a click the encoder's speed left full speed [s]."""
    end = time.monotonic() + 30.0
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


def click_time(tab: Tab, name: str) -> float:
    """Click a button and return the time of its click event [s since the epoch]."""
    tab.button(name).evaluate(
        "b => b.addEventListener('click', () => { window.clicked = Date.now() }, {once: true})"
    )
    tab.button(name).click()
    return float(tab.page.evaluate("window.clicked")) / 1000.0


def test_first_paint_comes_within_a_second(desk: Tab) -> None:
    paints = desk.page.evaluate(
        "Object.fromEntries(performance.getEntriesByType('paint').map(e => [e.name, e.startTime]))"
    )
    assert paints["first-paint"] < 1000.0


def test_idle_machine_can_be_started_and_nothing_else_is_off(desk: Tab, pictures: Path) -> None:
    desk.phase("idle")
    for name in ("Start", "Stop", "Reset", "EMERGENCY STOP"):
        desk.wait_for(
            f"[...document.querySelectorAll('header button')]"
            f".find(b => b.innerText === '{name}').disabled === false"
        )
    desk.page.screenshot(path=pictures / "idle.png")


def test_case_and_law_are_prepared_on_every_node(desk: Tab) -> None:
    setup = desk.page.locator(".setup")
    setup.get_by_label("Material law").click()
    desk.page.get_by_role("option", name="neo hookean").click()
    setup.get_by_label("Case").click()
    desk.page.get_by_role("option", name=re.compile("^5:")).click()
    setup.get_by_role("button", name="Prepare").click()
    desk.wait_for("document.querySelector('.said').innerText.includes('ready to wind case 5')")
    desk.wait_for(
        "[...document.querySelectorAll('.nodes tbody tr')].slice(0, 4)"
        ".every(row => row.innerText.includes('active'))"
    )


def test_start_makes_numbers_move(desk: Tab, operated: Any) -> None:
    desk.button("Start").click()
    desk.phase("winding")
    wait(full_speed(operated))
    desk.wait_for("parseFloat(document.querySelector('.tile .value').innerText) > 1.6")
    first = desk.page.locator(".clock").inner_text()
    desk.wait_for(f"document.querySelector('.clock').innerText !== '{first}'")
    # The lay is that of case 5, whose marker spacing is 100 mm.
    desk.wait_for("document.querySelectorAll('.camera polygon').length > 0")
    desk.wait_for(
        "parseFloat(document.querySelector('table.plain tbody td:nth-child(5)').innerText) > 90"
    )


def test_pictures_fit_the_desk_and_the_phone(
    desk: Tab, phone: Tab, operated: Any, pictures: Path
) -> None:
    for tab, name in ((desk, "desk"), (phone, "phone")):
        tab.phase("winding")
        tab.wait_for("document.querySelectorAll('.chart canvas').length === 4")
        tab.page.screenshot(path=pictures / f"{name}.png")
        tab.page.screenshot(path=pictures / f"{name}-whole.png", full_page=True)
        wide = tab.page.evaluate(
            "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"
        )
        assert wide[0] <= wide[1]
        assert tab.page.evaluate(CLIPPED) == []
        assert tab.page.evaluate(OVERLAPPING) == []
    check(phone, operated)
    print(f"pictures in {pictures}")


# Labels whose text does not fit their box, or that stick out of their card.
CLIPPED = """
() => [...document.querySelectorAll('.card, header')].flatMap(card => {
  const room = card.getBoundingClientRect();
  return [...card.querySelectorAll('.nicegui-label, .q-btn, th, td')].filter(item => {
    const box = item.getBoundingClientRect();
    return box.width > 0 && !item.closest('.scene') && !item.closest('.buttons') &&
      (item.scrollWidth > item.clientWidth + 1 && getComputedStyle(item).display !== 'inline' ||
       box.right > room.right + 1 || box.left < room.left - 1);
  }).map(item => item.innerText);
})
"""
# Cards and the header's parts may touch, not cover each other.
OVERLAPPING = """
() => {
  const found = [];
  for (const group of ['.card', 'header > *']) {
    const boxes = [...document.querySelectorAll(group)]
      .filter(item => getComputedStyle(item).position !== 'fixed')
      .map(item => [item.className, item.getBoundingClientRect()])
      .filter(([, box]) => box.width > 0 && box.height > 0);
    for (let i = 0; i < boxes.length; i++) for (let j = i + 1; j < boxes.length; j++) {
      const [a, b] = [boxes[i][1], boxes[j][1]];
      if (a.left < b.right - 1 && b.left < a.right - 1 &&
          a.top < b.bottom - 1 && b.top < a.bottom - 1)
        found.push(boxes[i][0] + ' / ' + boxes[j][0]);
    }
  }
  return found;
}
"""


def test_every_control_is_reached_by_keyboard(desk: Tab) -> None:
    desk.page.locator("body").focus()
    reached = set()
    for _ in range(12):
        desk.page.keyboard.press("Tab")
        reached.add(desk.page.evaluate("document.activeElement.innerText"))
    assert {"Stop", "EMERGENCY STOP"} <= reached


def test_server_takes_less_than_a_third_of_a_core(operated: Any, desk: Tab) -> None:
    before, begin = operated.server.cpu_times(), time.monotonic()
    desk.page.wait_for_timeout(5000)
    after, passed = operated.server.cpu_times(), time.monotonic() - begin
    used = (after.user - before.user + after.system - before.system) / passed
    print(f"the page's server takes {used:.2f} of a core")
    assert used < 0.3


def test_stop_acts_within_three_tenths_of_a_second(desk: Tab, operated: Any) -> None:
    tries = []
    while len(tries) < TRIES and (not tries or tries[-1] >= STOP_ACTS_WITHIN):
        if tries:
            desk.button("Start").click()
        wait(full_speed(operated))
        tries.append(slowed_after(operated, click_time(desk, "Stop")))
        desk.phase("idle")
    print(f"the cylinder slows {min(tries):.3f} s after the click on Stop, of {len(tries)} tries")
    assert min(tries) < STOP_ACTS_WITHIN


def test_emergency_stop_acts_at_once(desk: Tab, operated: Any) -> None:
    tries = []
    while len(tries) < TRIES and (not tries or tries[-1] >= STOP_ACTS_WITHIN):
        if tries:
            reset(desk)
        desk.button("Start").click()
        wait(full_speed(operated))
        tries.append(slowed_after(operated, click_time(desk, "EMERGENCY STOP")))
        desk.phase("emergency stop")
    print(f"the cylinder slows {min(tries):.3f} s after EMERGENCY STOP, of {len(tries)} tries")
    assert min(tries) < STOP_ACTS_WITHIN


def test_reset_begins_a_new_run_that_can_be_started(desk: Tab, operated: Any) -> None:
    desk.wait_for(
        "[...document.querySelectorAll('header button')]"
        ".find(b => b.innerText === 'Start').disabled"
    )
    reset(desk)
    desk.button("Start").click()
    desk.phase("winding")
    wait(full_speed(operated))
    desk.button("Stop").click()
    desk.phase("idle")


def reset(desk: Tab) -> None:
    desk.button("Reset").click()
    desk.page.locator(".q-dialog").get_by_role("button", name="Reset").click()
    desk.phase("idle")
    desk.wait_for("document.querySelector('.said').innerText.includes('start of a run')")
    desk.wait_for(
        "[...document.querySelectorAll('header button')]"
        ".find(b => b.innerText === 'Start').disabled === false"
    )


def test_nobody_complained_and_nobody_outside_was_asked(desk: Tab, operated: Any) -> None:
    check(desk, operated)


def check(tab: Tab, operated: Any) -> None:
    assert tab.complaints == []
    own = (operated.url, operated.url.replace("http", "ws"), "data:", "blob:")
    assert [url for url in tab.asked if not url.startswith(own)] == []
