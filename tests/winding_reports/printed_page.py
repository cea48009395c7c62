"""What Chromium prints of a page, read back from the PDF with Poppler."""

import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest
from report_page import ReportPage

# A4 with margins of 14 mm, in points.
WIDTH, HEIGHT, MARGIN = 595.0, 842.0, 39.0
_NAMESPACE = "{http://www.w3.org/1999/xhtml}"


@dataclass(frozen=True, kw_only=True)
class PrintedWord:
    text: str  # Its letters
    page: int  # From 1
    left: float  # Its left edge [pt]
    right: float  # Its right edge [pt]
    top: float  # Its upper edge [pt]
    bottom: float  # Its lower edge [pt]

    @property
    def inside(self) -> bool:
        """Whether the whole word lies between the margins, but for rounding."""
        return (
            self.left >= MARGIN - 1.0
            and self.right <= WIDTH - MARGIN + 1.0
            and self.top >= MARGIN - 1.0
            and self.bottom <= HEIGHT - MARGIN + 1.0
        )


def printed_words(page: Path, folder: Path) -> list[PrintedWord]:
    """Print a page and return its words; skip the test where Chromium or Poppler is missing."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    reader = shutil.which("pdftotext")
    if chromium is None or reader is None:
        pytest.skip("printing needs chromium and pdftotext")
    pdf, boxes = folder / "page.pdf", folder / "page.html"
    subprocess.run(
        [
            *(chromium, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic"),
            *("--no-first-run", "--disable-background-networking", "--disable-component-update"),
            *("--disable-sync", "--no-pdf-header-footer", f"--user-data-dir={folder / 'profile'}"),
            *(f"--print-to-pdf={pdf}", page.absolute().as_uri()),
        ],
        check=True,
        capture_output=True,
        timeout=120,
    )
    subprocess.run([reader, "-bbox", str(pdf), str(boxes)], check=True, timeout=60)
    pages = ET.fromstring(boxes.read_bytes()).iter(f"{_NAMESPACE}page")
    words = []
    for number, sheet in enumerate(pages, start=1):
        assert float(sheet.attrib["width"]) == pytest.approx(WIDTH, abs=1.0)
        assert float(sheet.attrib["height"]) == pytest.approx(HEIGHT, abs=1.0)
        words += [
            PrintedWord(
                text=word.text or "",
                page=number,
                left=float(word.attrib["xMin"]),
                right=float(word.attrib["xMax"]),
                top=float(word.attrib["yMin"]),
                bottom=float(word.attrib["yMax"]),
            )
            for word in sheet.iter(f"{_NAMESPACE}word")
        ]
    return words


def missing_from_paper(html: str, words: list[PrintedWord]) -> Counter[str]:
    """Return the words of table cells, with their counts, that no whole word on paper shows."""
    return Counter(ReportPage(html).table_words) - Counter(
        word.text for word in words if word.inside
    )


def outside_the_margins(words: list[PrintedWord]) -> list[str]:
    """Return the words that stand in the margins; page numbers stand below the text."""
    return [word.text for word in words if not word.inside and word.top < HEIGHT - MARGIN]
