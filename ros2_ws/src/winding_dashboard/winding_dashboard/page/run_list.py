"""The runs of a folder, newest first, with their outcomes and where their reports are."""

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from winding_dashboard.page.band import outcome_cell
from winding_dashboard.page.cell import Cell
from winding_dashboard.page.condition_form import brief

# A run's folder has these two; a session's further runs are one level below its first.
_NUMBERS, _REPORT = "run.json", "report"
_LEVELS = ("", "*/", "*/*/")
_MOST = 50
# Options of a run's condition by which an operator tells it from another.
_MEASURES = {
    "tension_n": "weight",
    "cylinder_diameter_mm": "cylinder_mm",
    "cable_diameter_mm": "cable_mm",
}


@dataclass(frozen=True, kw_only=True)
class ListedRun:
    """One run."""

    date: str  # When it was begun, UTC; empty when it is not recorded
    condition: str  # What was wound
    outcome: Cell  # How it came out
    report: str  # Path of its page below the folder; empty without one


class RunList:
    """Runs below a folder, read again when a file has changed.

    A run is a `run.json` in the folder or up to two levels below it, with the folder `report`
    beside it.

    Args:
        folder: None for no list.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self._known: dict[Path, tuple[int, ListedRun]] = {}

    def runs(self) -> list[ListedRun]:
        """Return the newest runs, newest first."""
        if self.folder is None:
            return []
        found = [path for level in _LEVELS for path in self.folder.glob(f"{level}{_NUMBERS}")]
        changed: dict[Path, int] = {}
        for path in found:
            # Folders may be moved away meanwhile.
            with suppress(FileNotFoundError):
                changed[path] = path.stat().st_mtime_ns
        newest = sorted(changed, key=lambda path: changed[path], reverse=True)[:_MOST]
        self._known = {path: self._look(path, changed[path]) for path in newest}
        return [run for _, run in self._known.values()]

    def file(self, path: str) -> Path | None:
        """Return the file of a report by its path below the folder; None for anything else."""
        if self.folder is None:
            return None
        wanted = (self.folder / path).resolve()
        if not wanted.is_relative_to(self.folder.resolve()) or not wanted.is_file():
            return None
        below = wanted.relative_to(self.folder.resolve()).parts[:-1]
        return wanted if _REPORT in below else None

    def _look(self, path: Path, changed: int) -> tuple[int, ListedRun]:
        assert self.folder is not None
        page = path.parent / _REPORT / "index.html"
        report = str(page.relative_to(self.folder)) if page.is_file() else ""
        known = self._known.get(path)
        # A report comes a moment after the numbers.
        if known is not None and known[0] == changed and known[1].report == report:
            return known
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            return changed, _listed(content, report)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            return changed, ListedRun(
                date=str(path.relative_to(self.folder)),
                condition="",
                outcome=Cell(word="", remark=f"cannot be read: {error}"),
                report=report,
            )


def _listed(content: Mapping[str, Any], report: str) -> ListedRun:
    outcome = content["outcome"]
    return ListedRun(
        date=str(content["identity"].get("date") or "").replace("T", " ").removesuffix("Z"),
        condition=_condition(content),
        outcome=outcome_cell(outcome["verdict"], outcome["sentences"]),
        report=report,
    )


def _condition(content: Mapping[str, Any]) -> str:
    number = int(content["case"])
    name = f"case {number}" if number else "own condition"
    wound = content["identity"].get("condition", {})
    measures = {item: wound.get(key, {}).get("value") for key, item in _MEASURES.items()}
    return brief(name, **measures) if all(measures.values()) else name
