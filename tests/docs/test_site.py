"""The site shows what was tested; opened as files it can be read by everybody, and searched."""

import os
import re
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest
from accessibility import grave_findings, opened
from chromium import chromium

from processes import ran

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
EXAMPLES = sorted((ROOT / "examples" / "gallery").glob("*.py"))
LARGEST_PICTURE = 100_000
# One of each kind: entry, table, tutorial with commands, decision, code and pictures.
PAGES = (
    "index.html",
    "commands.html",
    "tutorials/newcomer.html",
    "decisions/0018-one-snapshot-at-a-time.html",
    "gallery.html",
)


class CodeBlocks(HTMLParser):
    """Texts of a page's code blocks, as copied from it: `blocks` has (language, title, text)."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.blocks: list[tuple[str, str, str]] = []
        self.pictures: list[str] = []
        self._language = self._title = ""
        self._inside: str | None = None
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = dict(attributes)
        kind = re.match(r"language-(\w+) highlight", given.get("class") or "")
        if tag == "div" and kind:
            self._language, self._title = kind[1], ""
        if tag == "span" and given.get("class") == "filename":
            self._inside = "title"
        if tag == "code" and self._language:
            self._inside = "code"
            self.blocks.append((self._language, self._title, ""))
        if tag == "img":
            self.pictures.append(given.get("src") or "")

    def handle_endtag(self, tag: str) -> None:
        if tag == "code" and self._inside == "code":
            self._inside, self._language = None, ""
        if tag == "span" and self._inside == "title":
            self._inside = None

    def handle_data(self, data: str) -> None:
        if self._inside == "title":
            self._title += data
        if self._inside == "code":
            language, title, text = self.blocks[-1]
            self.blocks[-1] = (language, title, text + data)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    configuration = ROOT / "site" / "mkdocs.yml"
    finished = ran(
        # With --quiet no warning is counted, and --strict has nothing to fail on.
        *(sys.executable, "-m", "mkdocs", "build", "--strict"),
        *("--config-file", configuration, "--site-dir", folder),
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )
    assert finished.returncode == 0, finished.stderr
    return folder


@pytest.mark.parametrize("name", ["gallery", *(f"tutorials/{path.stem}" for path in TUTORIALS)])
def test_a_reader_of_the_site_copies_the_commands_that_are_tested(
    site: Path, name: str, shell_blocks: Callable[[Path], list[str]]
) -> None:
    shown = [
        text for language, _, text in CodeBlocks(site / f"{name}.html").blocks if language == "sh"
    ]
    tested = shell_blocks(ROOT / "docs" / f"{name}.md")
    assert tested
    assert shown == tested


def test_the_gallery_shows_the_programs_that_are_tested(site: Path) -> None:
    blocks = CodeBlocks(site / "gallery.html").blocks
    shown = {title: text for language, title, text in blocks if language == "python"}
    tested = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in EXAMPLES
    }
    assert shown == tested


def test_the_gallery_shows_what_its_programs_draw(site: Path) -> None:
    pictures = {Path(source) for source in CodeBlocks(site / "gallery.html").pictures}
    drawn = {
        f"gallery-{path.stem.replace('_', '-')}.webp"
        for path in EXAMPLES
        if "savefig" in path.read_text(encoding="utf-8")
    }
    assert {path.name for path in pictures} == drawn
    assert all((site / path).stat().st_size <= LARGEST_PICTURE for path in pictures)


@pytest.mark.campaign
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


@pytest.mark.campaign
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
