"""EMERGENCY STOP in a real browser: within reach of mouse and keyboard whatever the page shows."""

import json
import os
import select
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser_tab import TAB_PATIENCE

pytestmark = [pytest.mark.slow]

QUESTIONS = {
    "reset": "ask-reset",
    "prepare": "ask-prepare",
    "record": "ask-record",
    "mode-drive": "ask-drive",
    "mode-watch": "ask-watch",
    "mode-off": "ask-off",
}
TOLD = b"told emergency_stop"
# Whether the middle of a button is the button, and not something that covers it.
UNCOVERED = """
id => {
  const box = byId(id).getBoundingClientRect();
  const top = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
  return byId(id).contains(top) && box.bottom <= innerHeight && !byId(id).disabled;
}
"""


def stopped(page: Any) -> None:
    """Wait until the graph behind a page is asked for an emergency stop; forget what came then."""
    output, heard = page.process.stdout.fileno(), b""
    while TOLD not in heard:
        assert select.select([output], [], [], TAB_PATIENCE)[0], heard
        heard += os.read(output, 65536)


def everything_asks(route: Any) -> None:
    """Let a snapshot ask before each action that it can ask about."""
    answer = route.fetch()
    seen = answer.json()
    seen["ask"], seen["off"] = QUESTIONS, dict.fromkeys(seen["off"], "")
    seen["hidden"] |= dict.fromkeys(("control-card", *filter(seen["hidden"].get, QUESTIONS)), False)
    route.fulfill(response=answer, body=json.dumps(seen))


@pytest.fixture(params=["desk", "phone"])
def asking(request: Any, standing_page: Any, new_tab: Callable[[str, str], Any]) -> Iterator[Any]:
    """A tab in which every action asks, beside one that is offline."""
    offline = new_tab("desk", standing_page.url)
    offline.wait_for("shown.sequence > 0")
    offline.page.context.set_offline(True)
    tab = new_tab(request.param, standing_page.url)
    tab.page.route("**/snapshot*", everything_asks)
    tab.wait_for("shown.form?.fields && shown.ask.record === 'ask-record'")
    yield tab
    tab.page.unroute_all(behavior="ignoreErrors")


def test_stop_is_pressed_while_a_question_is_open(
    asking: Any, standing_page: Any, pictures: Path
) -> None:
    page = asking.page
    for action, question in QUESTIONS.items():
        page.locator(f"#{action}").click()
        asking.wait_for(f"byId('{question}').open")
        assert asking.measured("document.querySelectorAll('dialog[open]').length") == 1
        for button in ("stop", "emergency_stop"):
            assert page.evaluate(UNCOVERED, button), (question, button)
        assert asking.misfits() == []
        asking.shoot(pictures, f"{question}-{page.viewport_size['width']}")
        # By keyboard, from where the question has put the focus.
        for _ in range(8):
            page.keyboard.press("Shift+Tab")
            if page.evaluate("document.activeElement.id") == "emergency_stop":
                break
        page.keyboard.press("Enter")
        stopped(standing_page)
        asking.button("EMERGENCY STOP").click()
        stopped(standing_page)
        page.locator(f"#{question} [data-keep]").focus()
        page.keyboard.press("Escape")
        asking.wait_for(f"!byId('{question}').open")
        assert page.evaluate("document.activeElement.id") == action
    page.get_by_label("Error of a length, %").focus()
    page.keyboard.press("Alt+e")
    stopped(standing_page)


def test_question_that_is_no_longer_to_be_asked_goes(asking: Any) -> None:
    asking.page.locator("#record").click()
    asking.wait_for("byId('ask-record').open")
    asking.page.unroute_all(behavior="ignoreErrors")
    asking.wait_for("!byId('ask-record').open")


def test_stop_goes_before_requests_that_are_never_answered(
    standing_page: Any, new_tab: Callable[[str, str], Any]
) -> None:
    tab = new_tab("desk", standing_page.url)
    tab.wait_for("shown.form?.fields")
    # A browser has six connections to a server.
    tab.page.evaluate("for (let n = 0; n < 9; n++) byId('record').click()")
    tab.button("EMERGENCY STOP").click()
    stopped(standing_page)
    tab.answered("emergency stop: done")


def test_stop_of_an_offline_page_says_that_it_is_not_answered(
    standing_page: Any, new_tab: Callable[[str, str], Any]
) -> None:
    tab = new_tab("phone", standing_page.url)
    tab.wait_for("shown.sequence > 0")
    tab.page.context.set_offline(True)
    tab.button("EMERGENCY STOP").click()
    tab.answered("use the machine's own controls")
