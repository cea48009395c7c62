"""The site can be read by everybody: every kind of page, in both themes."""

import subprocess
import sys
from pathlib import Path

import pytest
from accessibility import grave_findings, opened
from chromium import chromium

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
# One of each kind: entry, table, tutorial with commands, decision, code and pictures.
PAGES = (
    "index.html",
    "commands.html",
    "tutorials/newcomer.html",
    "decisions/0018-one-snapshot-at-a-time.html",
    "gallery.html",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--config-file",
         str(ROOT / "site" / "mkdocs.yml"), "--site-dir", str(folder)],
        check=True, cwd=ROOT,
    )  # fmt: skip
    return folder


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
