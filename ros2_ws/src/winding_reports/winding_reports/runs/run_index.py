"""The index over a folder of runs: SQLite, rebuilt from the folders whenever it is missing."""

import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from winding_reports.runs.run_row import BROKEN_OFF, TWIN, RunRow, row_of_file

INDEX = ".runs.sqlite"
NUMBERS, LOG = "run.json", "log"
# Of the columns; another one is built anew.
_VERSION = 1
_COLUMNS = RunRow._fields
_KEPT = ", ".join(f'"{name}"' for name in _COLUMNS)
# A copy of a run's numbers is not a second run.
_AS_TWIN = {"verdict": f"'{TWIN}'", "good": "0", "healthy": "0", "reason": "'a copy of ' || twin"}
_LISTED = ", ".join(
    f'CASE WHEN twin = path THEN "{name}" ELSE {_AS_TWIN[name]} END AS "{name}"'
    if name in _AS_TWIN
    else f'"{name}"'
    for name in _COLUMNS
)
_SCHEMA = f"""
CREATE TABLE runs ({_KEPT}, twin, stamp, PRIMARY KEY (path)) WITHOUT ROWID;
CREATE INDEX by_id ON runs (run_id, path);
CREATE VIEW listed AS SELECT {_LISTED} FROM runs;
PRAGMA user_version = {_VERSION};
"""
_BUSY_S = 30.0


class RunIndexError(ValueError):
    """There is no folder of runs, or no such run in it."""


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Which runs of an index; empty for all."""

    cable: str = ""  # Of the run's labels
    machine: str = ""  # Likewise
    batch: str = ""  # Likewise
    operator: str = ""  # Likewise
    remark: str = ""  # Part of it
    verdict: str = ""  # One of VERDICTS
    since: str = ""  # First date, ISO 8601 or the beginning of it
    until: str = ""  # Last date, likewise

    def where(self) -> tuple[str, list[str]]:
        """Return the condition in SQL, and its values."""
        terms, values = ["1"], []
        for name, text in vars(self).items():
            if text:
                terms.append(
                    {
                        "remark": "instr(lower(remark), lower(?))",
                        "since": "date >= ?",
                        "until": "substr(date, 1, length(?)) <= ?",
                    }.get(name, f'"{name}" = ?')
                )
                values += [text] * (2 if name == "until" else 1)
        return " AND ".join(terms), values


class RunIndex:
    """Rows of all runs below a folder, as they are when it is opened.

    Args:
        folder: Of runs. The index lies in it, or in memory where nothing can be written there.

    Raises:
        RunIndexError: There is no such folder.
    """

    def __init__(self, folder: Path) -> None:
        if not folder.is_dir():
            raise RunIndexError(f"there is no folder of runs {folder}")
        self._folder = folder
        try:
            self._database = _opened(folder / INDEX)
            self._refresh()
        except sqlite3.DatabaseError:
            # It is damaged, another version's, or cannot be written.
            with suppress(OSError):
                (folder / INDEX).unlink(missing_ok=True)
            try:
                self._database = _opened(folder / INDEX)
                self._refresh()
            except sqlite3.DatabaseError:
                self._database = _opened(":memory:")
                self._refresh()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._database.close()

    def rows(self, selection: Selection | None = None, newest: int | None = None) -> list[RunRow]:
        """Return runs in the order of their dates, those without one first; only so many."""
        where, values = (selection or Selection()).where()
        order = f"SELECT * FROM listed WHERE {where} ORDER BY date DESC, path DESC LIMIT ?"
        found = self._database.execute(order, [*values, -1 if newest is None else newest])
        return [RunRow._make(row) for row in found][::-1]

    def counts(self, selection: Selection | None = None) -> dict[str, int]:
        """Return how many runs there are of each verdict."""
        where, values = (selection or Selection()).where()
        order = f"SELECT verdict, count(*) FROM listed WHERE {where} GROUP BY verdict ORDER BY 1"
        return dict(self._database.execute(order, values).fetchall())

    def run(self, name: str) -> RunRow:
        """Return the run of an id, of a folder from the indexed one, or of a beginning of either.

        Raises:
            RunIndexError: There is none, or there are several.
        """
        order = "SELECT * FROM listed WHERE path = ? OR (run_id = ? AND verdict <> ?)"
        found = self._database.execute(order, (name, name, TWIN)).fetchall()
        if not found:
            order = (
                "SELECT * FROM listed WHERE substr(path, 1, length(?1)) = ?1 "
                "OR (substr(run_id, 1, length(?1)) = ?1 AND verdict <> ?2) LIMIT 3"
            )
            found = self._database.execute(order, (name, TWIN)).fetchall()
        if not found:
            raise RunIndexError(f"{self._folder} has no run {name}")
        if len(found) > 1:
            several = " and ".join(str(row[0]) for row in found[:2])
            raise RunIndexError(f"several runs begin with {name}: {several}")
        return RunRow._make(found[0])

    def _refresh(self) -> None:
        """Read what is new or changed since the last time, and forget what is gone."""
        known = dict(self._database.execute("SELECT path, stamp FROM runs"))
        found = dict(_stamps(self._folder))
        changed = {path: stamp for path, stamp in found.items() if known.get(path) != stamp}
        gone = [(path,) for path in known.keys() - found.keys()]
        if not (changed or gone):
            return
        places = ", ".join("?" * (len(_COLUMNS) + 1))
        order = f"INSERT OR REPLACE INTO runs ({_KEPT}, stamp) VALUES ({places})"
        with self._database:
            self._database.executemany("DELETE FROM runs WHERE path = ?", gone)
            self._database.executemany(order, _read(self._folder, changed))
            self._database.execute(
                "UPDATE runs SET twin = coalesce((SELECT min(other.path) FROM runs AS other "
                "WHERE other.run_id = runs.run_id), path)"
            )


def _opened(path: Path | str) -> sqlite3.Connection:
    database = sqlite3.connect(path, timeout=_BUSY_S)
    (version,) = database.execute("PRAGMA user_version").fetchone()
    if version not in (0, _VERSION):
        database.close()
        raise sqlite3.DatabaseError(f"an index of version {version}")
    if version == 0:
        database.executescript(f"BEGIN EXCLUSIVE; {_SCHEMA} COMMIT;")
    return database


def _stamps(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield every run's folder, from the indexed one, and what changes when its numbers do."""
    waiting = [(str(folder), "")]
    while waiting:
        place, path = waiting.pop()
        folders, numbers = [], None
        try:
            with os.scandir(place) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.name)
                    elif entry.name == NUMBERS:
                        numbers = entry.stat()
        except OSError:
            # It was removed meanwhile, or may not be read.
            continue
        begun = LOG in folders
        if numbers is not None:
            yield path or ".", f"{numbers.st_mtime_ns} {numbers.st_size} {numbers.st_ino}"
        elif begun:
            yield path or ".", BROKEN_OFF
        for name in folders:
            # A run has logs and a report; the further runs of an operator lie in it, too.
            within = numbers is None and not begun
            if not name.startswith(".") and (within or not path or name.startswith("run-")):
                waiting.append((f"{place}/{name}", f"{path}/{name}" if path else name))


def _read(folder: Path, changed: Mapping[str, str]) -> Iterator[Sequence[object]]:
    for path, stamp in changed.items():
        if stamp == BROKEN_OFF:
            reason = f"there is no {NUMBERS}: the run was broken off, or is not over"
            yield (*RunRow(path=path, verdict=BROKEN_OFF, reason=reason), stamp)
        else:
            yield (*row_of_file(path, folder / path / NUMBERS), stamp)
