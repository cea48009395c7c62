"""The examples of docs/solver.md run as they stand."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "solver.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.S)


def test_page_has_examples() -> None:
    assert len(BLOCKS) >= 9


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_example_runs(number: int) -> None:
    exec(compile(BLOCKS[number], f"solver.md[{number}]", "exec"), {"__name__": "example"})
