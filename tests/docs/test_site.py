"""What the site shows is what was tested: code blocks of the built pages against their sources."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
EXAMPLES = sorted((ROOT / "examples" / "gallery").glob("*.py"))
LARGEST_PICTURE = 100_000


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


def pasted(page: Path) -> list[str]:
    """Return the blocks of a page that `test_tutorials.py` pastes."""
    return re.findall(r"^```sh\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.M)


@pytest.mark.parametrize("name", ["gallery", *(f"tutorials/{path.stem}" for path in TUTORIALS)])
def test_a_reader_of_the_site_copies_the_commands_that_are_tested(site: Path, name: str) -> None:
    shown = [
        text for language, _, text in CodeBlocks(site / f"{name}.html").blocks if language == "sh"
    ]
    tested = pasted(ROOT / "docs" / f"{name}.md")
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
