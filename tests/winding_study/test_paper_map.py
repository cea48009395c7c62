"""The paper map names what exists."""

from __future__ import annotations

import importlib
import importlib.util
import re
from functools import reduce
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "paper-map.md"
PACKAGES = "|".join(
    (
        "cable_winding",
        "cable_fem_node",
        "marker_tracker_node",
        "winding_rig_node",
        "correction_node",
        "winding_study",
    )
)
NAMES = sorted(set(re.findall(rf"`((?:{PACKAGES})(?:\.\w+)+)`", PAGE.read_text("utf-8"))))


@pytest.mark.parametrize("name", NAMES)
def test_every_name_of_the_map_can_be_imported(name: str) -> None:
    parts = name.split(".")
    depth = max(i for i in range(1, len(parts)) if _is_module(".".join(parts[:i])))
    found = importlib.import_module(".".join(parts[:depth]))
    reduce(getattr, parts[depth:], found)


@pytest.mark.parametrize("kind", ["Table", "Figure", "Eq."])
def test_everything_that_the_paper_numbers_is_mapped(kind: str) -> None:
    last = {"Table": 8, "Figure": 11, "Eq.": 5}[kind]
    mapped: set[int] = set()
    for line in PAGE.read_text("utf-8").splitlines():
        match = re.match(rf"\| {re.escape(kind)}s? (\d+)(?: (to|and) (\d+))?", line)
        if match:
            mapped |= set(range(int(match[1]), int(match[3] or match[1]) + 1))
    assert mapped == set(range(1, last + 1))


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False
