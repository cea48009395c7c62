"""The site, built once for all tests that look at it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    configuration = ROOT / "site" / "mkdocs.yml"
    finished = subprocess.run(
        # With --quiet no warning is counted, and --strict has nothing to fail on.
        [sys.executable, "-m", "mkdocs", "build", "--strict",
         "--config-file", str(configuration), "--site-dir", str(folder)],
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip
    assert finished.returncode == 0, finished.stderr
    return folder
