"""The list of decisions is the list of their pages."""

import re
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docs" / "decisions"


def test_every_decision_is_listed_with_its_title_and_status() -> None:
    listed = (FOLDER / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| \[(.*)\]\((.*)\) \| (.*) \|$", listed, re.MULTILINE)
    pages = []
    for page in sorted(FOLDER.glob("0*.md")):
        text = page.read_text(encoding="utf-8")
        title = re.match(r"# (\d+)\. (.*)", text)
        status = re.search(r"^Status: (.*)", text, re.MULTILINE)
        assert title, page.name
        assert status, page.name
        pages.append((title[1], title[2], page.name, status[1]))
    assert rows == pages
