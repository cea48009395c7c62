"""The reports can be read by everybody."""

from pathlib import Path
from typing import Any

import pytest
from accessibility import grave_findings, opened
from chromium import chromium

from winding_reports.run_report.report import write_report

pytestmark = [pytest.mark.slow]


@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_nothing_grave_on_the_run_report(
    synthetic: Any, tmp_path: Path, width: int
) -> None:
    report = write_report(synthetic(), tmp_path)
    with chromium() as browser:
        page = opened(browser, report.as_uri(), width=width, dark=False)
        assert grave_findings(page) == []
