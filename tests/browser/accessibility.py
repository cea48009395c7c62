"""What axe-core finds on a page that a real Chromium shows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe

CHROMIUM = Path("/usr/bin/chromium")
# Of axe's four grades these two keep somebody from reading or from operating.
_GRAVE = ("serious", "critical")


@contextmanager
def chromium() -> Iterator[Any]:
    """Open a browser; where there is none the test is skipped."""
    if not CHROMIUM.exists():
        pytest.skip(f"no Chromium at {CHROMIUM}")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
        )
        yield launched
        launched.close()


def grave_findings(page: Any) -> list[str]:
    """Return what axe-core finds grave on an open page: rule, and the first places."""
    found = Axe().run(page).response["violations"]
    return [
        f"{item['id']}: {item['help']}: {[node['target'] for node in item['nodes']][:3]}"
        for item in found
        if item["impact"] in _GRAVE
    ]


def opened(browser: Any, url: str, *, width: int, dark: bool) -> Any:
    """Return a page of a width [px] in one of the two themes."""
    context = browser.new_context(
        viewport={"width": width, "height": 844}, color_scheme="dark" if dark else "light"
    )
    page = context.new_page()
    page.goto(url)
    return page
