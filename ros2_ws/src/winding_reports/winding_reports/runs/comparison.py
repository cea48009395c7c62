"""Two runs side by side: what differs in condition, outcome and numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from winding_reports.runs.run_row import UNREADABLE, RunRow, run_row

# What a row of the index says of the file and not of the run.
_OF_THE_INDEX = ("series", "healthy", "good")


def compared(first: Path, second: Path) -> dict[str, Any]:
    """Return two runs side by side as JSON values.

    Every number of the index is there, every marker, and of the condition what differs.

    Args:
        first: Its `run.json`.
        second: Its `run.json`.

    Raises:
        ValueError: One of them cannot be read.
    """
    runs = [_content(path) for path in (first, second)]
    pairs = zip(
        *(_values(path, run) for path, run in zip((first, second), runs, strict=True)), strict=True
    )
    rows = [_row(name, one, other) for (name, one), (_, other) in pairs]
    return {"runs": [str(first), str(second)], "rows": [*rows, *_markers(runs), *_condition(runs)]}


def _content(path: Path) -> Any:
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no JSON") from error
    row = run_row(str(path.parent), content)
    if row.verdict == UNREADABLE:
        raise ValueError(f"{path}: {row.reason}")
    return content


def _values(path: Path, content: Any) -> list[tuple[str, Any]]:
    row: RunRow = run_row(str(path.parent), content)
    return [item for item in row._asdict().items() if item[0] not in _OF_THE_INDEX]


def _row(name: str, first: Any, second: Any) -> dict[str, Any]:
    numbers = all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in (first, second)
    )
    difference = second - first if numbers and name != "case" else None
    return {"name": name, "first": first, "second": second, "difference": difference}


def _markers(runs: list[Any]) -> Iterator[dict[str, Any]]:
    markers = [{item["id"]: item for item in run.get("markers", [])} for run in runs]
    for number in sorted(markers[0].keys() | markers[1].keys()):
        for key in ("s_fem_m", "s_tracked_m", "s_corrected_m"):
            values = (marker.get(number, {}).get(key) for marker in markers)
            yield _row(f"P{number} {key}", *values)


def _condition(runs: list[Any]) -> Iterator[dict[str, Any]]:
    stated = [run["identity"].get("condition", {}) for run in runs]
    for name in sorted(stated[0].keys() | stated[1].keys()):
        values = [condition.get(name, {}).get("value") for condition in stated]
        if values[0] != values[1]:
            yield _row(name, *values)
