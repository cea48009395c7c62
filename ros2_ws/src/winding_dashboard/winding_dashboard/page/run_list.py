"""The runs of a folder, newest first, with what they are worth and where their reports are."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_NUMBERS = "run*.json"
_MOST = 50
_NUMBERED = re.compile(r"-(\d+)$")


@dataclass(frozen=True, kw_only=True)
class ListedRun:
    """One run.

    Attributes:
        date: When it was begun, UTC; empty when it does not say.
        condition: What was wound.
        verdict: In words.
        style: `good`, `not-good`, or empty where it cannot be judged.
        report: Path of its page below the folder; empty without one.
    """

    date: str
    condition: str
    verdict: str
    style: str
    report: str


class RunList:
    """Runs below a folder, read again when a file has changed.

    A run is a `run.json`, or `run-2.json` and so on, in the folder or one level below it; its
    report is the folder `report` beside it with the same number.

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
        found = [*self.folder.glob(_NUMBERS), *self.folder.glob(f"*/{_NUMBERS}")]
        changed = {path: path.stat().st_mtime_ns for path in found if path.is_file()}
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
        return wanted if any(part.startswith("report") for part in below) else None

    def _look(self, path: Path, changed: int) -> tuple[int, ListedRun]:
        known = self._known.get(path)
        # A report comes a moment after the numbers.
        if known is not None and known[0] == changed and known[1].report:
            return known
        assert self.folder is not None
        number = _NUMBERED.search(path.stem)
        name = f"report{number.group(0) if number else ''}"
        page = path.parent / name / "index.html"
        report = str(page.relative_to(self.folder)) if page.is_file() else ""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            return changed, _listed(content, report)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            return changed, ListedRun(
                date=path.name,
                condition="",
                verdict=f"cannot be read: {error}",
                style="",
                report=report,
            )


def _listed(content: Mapping[str, Any], report: str) -> ListedRun:
    verdict = content["error_verdict"]
    good, said = verdict["good"], str(verdict["sentence"])
    lay = content.get("verdict")
    if lay is not None:
        good = None if lay["kept"] is None else bool(lay["kept"]) and good is not False
        said = f"{lay['sentence']}; {said}"
    if content.get("ended"):
        said = f"ended early, {content['ended']}; {said}"
    return ListedRun(
        date=str(content["identity"].get("date") or "").replace("T", " ").removesuffix("Z"),
        condition=_condition(content),
        verdict=said,
        style={True: "good", False: "not-good"}.get(good, ""),
        report=report,
    )


def _condition(content: Mapping[str, Any]) -> str:
    number = int(content["case"])
    return f"case {number}" if number else "own condition"
