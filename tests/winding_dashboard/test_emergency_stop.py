"""EMERGENCY STOP in a real browser: within reach of mouse and keyboard whatever the page shows."""

import json
import os
import select
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser_tab import TAB_PATIENCE

pytestmark = [pytest.mark.slow]

# Of every action that has a question, the question.
QUESTIONS = """
Object.fromEntries([...document.querySelectorAll('dialog')].map(d => [actionOf(d), d.id]))
"""
ASKED = b"asked emergency_stop"
# Whether the middle of a button is the button, and not something that covers it.
UNCOVERED = """
id => {
  const box = byId(id).getBoundingClientRect();
  const top = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
  return byId(id).contains(top) && box.bottom <= innerHeight && !byId(id).disabled;
}
"""


def by_keyboard(page: Any) -> None:
    """Go from where the focus is to EMERGENCY STOP, and press it."""
    for _ in range(12):
        page.keyboard.press("Shift+Tab")
        if page.evaluate("document.activeElement.id") == "emergency_stop":
            break
    page.keyboard.press("Enter")


def asked(tab: Any, name: str) -> None:
    """Give a command again until it is not refused, as by a page that has fallen behind."""
    end = time.monotonic() + TAB_PATIENCE
    while (answer := tab.page.evaluate(f"post('command/{name}')"))["refused"]:
        assert time.monotonic() < end, answer
        tab.page.wait_for_timeout(100)


def stopped(page: Any) -> None:
    """Wait until the graph behind a page is asked for an emergency stop; forget what came then."""
    output, heard = page.process.stdout.fileno(), b""
    while ASKED not in heard:
        assert select.select([output], [], [], TAB_PATIENCE)[0], heard
        heard += os.read(output, 65536)


def everything_asks(tab: Any) -> dict[str, str]:
    """Let a tab ask before each action that it can ask about; return questions by action."""
    questions: dict[str, str] = tab.measured(QUESTIONS)

    def asks(route: Any) -> None:
        answer = route.fetch()
        seen = answer.json()
        seen["ask"], seen["off"] = questions, dict.fromkeys(seen["off"], "")
        seen["hidden"] |= {
            name: name not in ("control-card", *questions) and hidden
            for name, hidden in seen["hidden"].items()
        }
        route.fulfill(response=answer, body=json.dumps(seen))

    tab.page.route("**/snapshot*", asks)
    tab.wait_for("document.querySelector('dialog') && shown.ask.record === 'ask-record'")
    return questions


@pytest.fixture(params=["desk", "phone"])
def asking(request: Any, standing_page: Any, new_tab: Callable[[str, str], Any]) -> Iterator[Any]:
    """A tab in which every action asks, beside one that is offline."""
    offline = new_tab("desk", standing_page.url)
    offline.wait_for("shown.sequence > 0")
    offline.page.context.set_offline(True)
    tab = new_tab(request.param, standing_page.url)
    tab.wait_for("shown.form?.fields")
    tab.questions = everything_asks(tab)
    yield tab
    tab.page.unroute_all(behavior="ignoreErrors")


def test_stop_is_pressed_beside_a_question(asking: Any, standing_page: Any, pictures: Path) -> None:
    page = asking.page
    assert len(asking.questions) > 5
    for action, question in asking.questions.items():
        page.locator(f"#{action}").click()
        asking.wait_for(f"byId('{question}').open")
        assert asking.measured("document.querySelectorAll('dialog[open]').length") == 1
        for button in ("stop", "emergency_stop"):
            assert page.evaluate(UNCOVERED, button), (question, button)
        assert asking.misfits() == []
        asking.shoot(pictures, f"{question}-{page.viewport_size['width']}")
        # By keyboard, from where the question has put the focus.
        by_keyboard(page)
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


def test_stop_goes_before_requests_never_answered(standing_page: Any, new_tab: Any) -> None:
    tab = new_tab("desk", standing_page.url)
    tab.wait_for("shown.form?.fields")
    # A browser has six connections to a server.
    tab.page.evaluate("for (let n = 0; n < 9; n++) byId('record').click()")
    tab.button("EMERGENCY STOP").click()
    stopped(standing_page)
    tab.answered("emergency stop: done")


def test_stop_of_an_offline_page_says_it_is_not_answered(standing_page: Any, new_tab: Any) -> None:
    tab = new_tab("phone", standing_page.url)
    tab.wait_for("shown.sequence > 0")
    tab.page.context.set_offline(True)
    tab.button("EMERGENCY STOP").click()
    tab.answered("use the machine's own controls")


@pytest.mark.campaign
@pytest.mark.processes
@pytest.mark.timeout(1500)
@pytest.mark.parametrize("where", ["desk", "phone"])
@pytest.mark.parametrize("means", ["mouse", "keyboard"])
def test_the_machine_stops_from_every_state_of_the_page(
    operated: Any, new_tab: Callable[[str, str], Any], crowd: Any,
    where: str, means: str,
) -> None:  # fmt: skip
    offline = new_tab("phone", operated.url)
    offline.wait_for("shown.sequence > 0")
    offline.page.context.set_offline(True)
    tab = new_tab(where, operated.url)
    tab.wait_for("shown.form?.fields")
    questions = everything_asks(tab)
    for state in ("", "crowd", *questions.values()):
        tab.can("Start")
        asked(tab, "start")
        operated.motion.reach("winding", tab.page)
        if state == "crowd":
            port = int(operated.url.rsplit(":", 1)[1].strip("/"))
            crowd.half_open(port, b"POST /command/stop HTTP/1.1\r\nhost: 127.0.0.1\r\n")
        elif state:
            tab.page.evaluate("id => byId(id).show()", state)
            assert tab.measured(f"byId('{state}').open")
        if means == "mouse":
            tab.button("EMERGENCY STOP").click()
        elif state in questions.values():
            by_keyboard(tab.page)
        else:
            tab.page.keyboard.press("Alt+e")
        operated.motion.reach("emergency stop", tab.page)
        asked(tab, "reset")
        operated.motion.reach("idle", tab.page)
    assert [text for text in tab.complaints if "ERR_" not in text] == []
    tab.page.unroute_all(behavior="ignoreErrors")
    for opened in (tab, offline):
        opened.page.close()
