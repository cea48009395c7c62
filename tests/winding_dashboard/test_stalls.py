"""A browser that was away shows the present at once, and never the past as the present."""

import json
import time
from collections.abc import Iterator
from typing import Any

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

PATIENCE = 60.0
# What a person reads: everything but the age of a page that has none, and what stands in fields.
READ = """
() => [shown.sequence, document.body.classList.contains('old'), JSON.stringify([
  document.body.innerText,
  [...document.querySelectorAll('input, select')].map(field => field.type === 'checkbox'
    ? field.checked : field.value),
  [...document.querySelectorAll('button')].map(button => button.disabled),
  [...document.querySelectorAll('svg')].map(drawing => drawing.innerHTML),
])]
"""
# The answer to the evaluation is on its way before the thread is busy.
STALL = """
s => {
  window.stalled = false;
  setTimeout(() => {
    const end = performance.now() + 1000 * s;
    while (performance.now() < end);
    window.stalled = true;
  });
}
"""
WATCH = """
() => {
  window.clocks = [];
  const note = () => window.clocks.push([shown.resets, parseFloat(byId('clock').textContent)]);
  const all = {childList: true, characterData: true, subtree: true};
  new MutationObserver(note).observe(byId('clock'), all);
  note();
}
"""


@pytest.fixture(scope="module")
def url(controlled_page: Any) -> str:
    return str(controlled_page.url)


@pytest.fixture
def four_tabs(url: str, browser: Any) -> Iterator[list[Any]]:
    pages = [opened(browser, url, (1280, 800)) for _ in range(4)]
    for page in pages:
        page.evaluate(WATCH)
    yield pages
    for page in pages:
        page.context.close()


@pytest.fixture
def tab(url: str, browser: Any) -> Iterator[Any]:
    page = opened(browser, url, (1280, 800))
    page.evaluate(WATCH)
    yield page
    page.context.close()


def opened(browser: Any, url: str, size: tuple[int, int]) -> Any:
    # Waits evaluate text, which the page's content security policy forbids.
    viewport = {"width": size[0], "height": size[1]}
    page = browser.new_context(viewport=viewport, bypass_csp=True).new_page()
    page.set_default_timeout(1000.0 * PATIENCE)
    page.goto(url)
    page.wait_for_function("shown.sequence >= 0")
    return page


def settled(page: Any) -> float:
    """Wait until a page shows what a fresh one shows; return how long that took [s]."""
    began = time.monotonic()
    fresh = opened(page.context.browser, page.url, (1280, 800))
    opened_after = time.monotonic() - began
    try:
        while time.monotonic() - began < PATIENCE:
            one, other = page.evaluate(READ), fresh.evaluate(READ)
            if one[0] == other[0] and not one[1] and not other[1]:
                assert json.loads(one[2]) == json.loads(other[2])
                return time.monotonic() - began - opened_after
    finally:
        fresh.context.close()
    return pytest.fail(f"the page is not of the present {PATIENCE:g} s later")


def clock_goes_on(page: Any) -> None:
    clocks = [clock for resets, clock in page.evaluate("window.clocks") if clock is not None]
    assert clocks
    assert clocks == sorted(clocks)


def stall(pages: list[Any], seconds: float) -> None:
    """Keep the only thread of each page busy, as a machine without time for it does."""
    for page in pages:
        page.evaluate(STALL, seconds)
    for page in pages:
        page.wait_for_function("window.stalled")


def cut(pages: list[Any], seconds: float) -> None:
    for page in pages:
        page.context.set_offline(True)
    pages[-1].wait_for_timeout(1000.0 * seconds)
    for page in pages:
        assert page.evaluate(READ)[1], "what stands there is old, and the page does not say so"
        assert "s old: the page's server does not answer" in page.locator("#age").inner_text()
        page.context.set_offline(False)


@pytest.mark.parametrize("seconds", [2.0, 4.0])
def test_browser_that_stalls_shows_the_present_afterwards(tab: Any, seconds: float) -> None:
    stall([tab], seconds)
    print(f"of the present {settled(tab):.2f} s after a stall of {seconds:g} s")
    clock_goes_on(tab)


def test_cut_network_is_reported_and_then_forgotten(tab: Any) -> None:
    cut([tab], 2.5)
    print(f"of the present {settled(tab):.2f} s after a network that was cut")
    assert tab.locator("#age").is_hidden()
    clock_goes_on(tab)


def test_what_is_typed_outlives_a_stall_and_a_cut_network(tab: Any) -> None:
    tab.get_by_label("Error of a length, %").fill("3.25")
    stall([tab], 2.0)
    cut([tab], 2.5)
    tab.wait_for_function("!document.body.classList.contains('old')")
    assert tab.get_by_label("Error of a length, %").input_value() == "3.25"


def test_late_answer_is_not_shown(tab: Any) -> None:
    """The answer to a question from before a stall is of the past when the stall ends."""
    tab.evaluate(
        "() => { window.applied = []; const old = apply;"
        "apply = s => { window.applied.push(performance.now() - asked); old(s); } }"
    )
    for _ in range(5):
        stall([tab], 1.5)
        tab.wait_for_timeout(300)
    assert max(tab.evaluate("window.applied")) < 1000.0


def test_two_browsers_and_a_phone_read_the_same(tab: Any, browser: Any, url: str) -> None:
    phone = opened(browser, url, (390, 844))
    tab.wait_for_function("shown.sequence > 5")
    end = time.monotonic() + PATIENCE
    while (one := tab.evaluate(READ))[0] != (other := phone.evaluate(READ))[0]:
        assert time.monotonic() < end
    # The phone leaves out the title, which is none of the run's.
    texts = [json.loads(read[2])[0].replace("Cable winding", "").split() for read in (one, other)]
    assert texts[0] == texts[1]
    phone.context.close()


@pytest.mark.campaign
@pytest.mark.parametrize("kind", [2.0, 9.0, 30.0, "network", "reload"])
def test_twenty_absences_leave_the_present(four_tabs: list[Any], kind: float | str) -> None:
    """Four tabs are away at the same time, in each of five ways."""
    if kind == "network":
        cut(four_tabs, 10.0)
    elif kind == "reload":
        for tab in four_tabs:
            tab.reload()
            tab.wait_for_function("shown.sequence >= 0")
            tab.evaluate(WATCH)
    else:
        stall(four_tabs, kind)
    for tab in four_tabs:
        print(f"{kind}: of the present {settled(tab):.2f} s later")
        clock_goes_on(tab)
