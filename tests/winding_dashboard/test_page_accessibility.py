"""The operator's page can be read and operated by everybody, in both themes and sizes."""

from typing import Any

import pytest
from accessibility import grave_findings, opened

pytestmark = [pytest.mark.slow]


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_nothing_grave(
    controlled_page: Any, browser: Any, width: int, dark: bool
) -> None:
    page = opened(browser, controlled_page.url, width=width, dark=dark)
    page.wait_for_function("document.querySelectorAll('.charts .curve').length > 1")
    page.locator("summary").click()
    assert grave_findings(page) == []
    page.context.close()


def test_axe_passes_a_question_and_an_old_page(controlled_page: Any, browser: Any) -> None:
    page = opened(browser, controlled_page.url, width=1280, dark=False)
    page.wait_for_function("shown.sequence >= 0")
    page.locator("#mode-watch").click()
    page.locator("#ask-watch").wait_for()
    assert grave_findings(page) == []
    page.keyboard.press("Escape")
    page.context.set_offline(True)
    page.wait_for_function("document.body.classList.contains('old')")
    assert grave_findings(page) == []
    page.context.close()
