"""A report's page as a reader of HTML sees it, and what every report must hold."""

import base64
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser


class ReportPage(HTMLParser):
    """Tags, links, anchors, headings, sources of pictures, cells and words of tables."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text = text
        self.tags: list[str] = []
        self.links: list[str] = []
        self.anchors: list[str] = []
        self.headings: list[str] = []
        self.sources: list[str] = []
        self.cells: list[list[str]] = []
        self.table_words: list[str] = []
        self._inside = ""
        self._in_cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = {name: value or "" for name, value in attrs}
        self.tags.append(tag)
        self.links += [named["href"]] if "href" in named else []
        self.sources += [named["src"]] if "src" in named else []
        self.anchors += [named["id"]] if "id" in named else []
        if tag == "tr":
            self.cells.append([])
        self._inside = tag
        self._in_cell = self._in_cell or tag in ("td", "th")

    def handle_endtag(self, tag: str) -> None:
        self._in_cell = self._in_cell and tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        if data.strip() and self._inside in ("h1", "h2"):
            self.headings.append(data.strip())
        if data.strip() and self._inside == "td":
            self.cells[-1].append(data.strip())
        self.table_words += data.split() if self._in_cell else []

    def require_whole(self) -> None:
        """Fail for a page that loads anything, or whose contents miss a heading."""
        assert not {"script", "link"} & set(self.tags)
        assert "url(" not in self.text
        assert self.tags.count("h2") == len(self.anchors) > 5
        assert self.links == [f"#{anchor}" for anchor in self.anchors]
        assert self.sources
        for source in self.sources:
            head, _, encoded = source.partition(",")
            assert head == "data:image/svg+xml;base64"
            drawing = base64.b64decode(encoded)
            assert ET.fromstring(drawing).tag == "{http://www.w3.org/2000/svg}svg"
            assert not re.search(rb'(href|src)="(?!#|data:image/png;base64,)', drawing)
