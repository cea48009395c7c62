"""The site in a browser, opened as files: it can be read by everybody, and searched."""

import re
from pathlib import Path

import pytest
from accessibility import grave_findings, opened
from chromium import chromium

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

# One of each kind: entry, table, tutorial with commands, decision, code and pictures.
PAGES = (
    "index.html",
    "commands.html",
    "tutorials/newcomer.html",
    "decisions/0018-one-snapshot-at-a-time.html",
    "gallery.html",
)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_axe_finds_nothing_grave_on_the_site(site: Path, dark: bool) -> None:
    found = {}
    with chromium() as browser:
        for name in PAGES:
            page = opened(browser, (site / name).as_uri(), width=1280, dark=dark)
            if findings := grave_findings(page):
                found[name] = findings
            page.context.close()
    assert found == {}


@pytest.mark.parametrize(
    ("entry", "words", "wanted"),
    [
        ("index.html", "track a film", "gallery.html"),
        ("tutorials/newcomer.html", "emergency stop", "dashboard.html"),
        ("reference/winding_core.html", "own cable", "tutorials/your-own-cable.html"),
    ],
)
def test_the_search_finds_the_task_first(site: Path, entry: str, words: str, wanted: str) -> None:
    with chromium() as browser:
        page = browser.new_page()
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.goto((site / entry).as_uri())
        page.click("[data-md-component=search-query]")
        page.keyboard.type(words)
        page.wait_for_selector(f".md-search-result__item > a[href*='{wanted}']")
        links = page.eval_on_selector_all(
            ".md-search-result__item > a", "all => all.map(one => one.href)"
        )
    pages = list(dict.fromkeys(re.sub("[?#].*", "", link) for link in links))
    assert (site / wanted).as_uri() in pages[:3], pages
    assert not any(link.endswith(("CHANGELOG.html", "licences.html")) for link in pages[:3])
    assert [url for url in asked if url.startswith("http")] == []
