"""What tests of the pages share: the commands that a reader pastes."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shell_blocks() -> Callable[[Path], list[str]]:
    """Return the `sh` blocks of a page, in order."""
    block = re.compile(r"^```sh\n(.*?)^```", re.DOTALL | re.MULTILINE)
    return lambda page: block.findall(page.read_text(encoding="utf-8"))
