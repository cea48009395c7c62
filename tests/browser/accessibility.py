"""What axe-core finds on a page that a real Chromium shows."""

from typing import Any

from axe_playwright_python.sync_playwright import Axe

# Of axe's four grades these two keep a user from reading or from operating.
_GRAVE = ("serious", "critical")


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
    # Waits evaluate text, which the page's content security policy forbids.
    context = browser.new_context(
        bypass_csp=True,
        viewport={"width": width, "height": 844},
        color_scheme="dark" if dark else "light",
    )
    page = context.new_page()
    page.goto(url)
    return page
