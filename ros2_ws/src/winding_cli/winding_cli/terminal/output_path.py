"""Where a command writes: checked before anything starts, there whole in the end or not at all."""

from __future__ import annotations

import json as json_format
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from winding_cli.terminal.refusal import FAILED, refuse
from winding_cli.terminal.termination import interruptible, uninterrupted

UNFINISHED = ".unfinished"
# What a trial writes [bytes]: a full disk may still have room for a name.
_TRIAL = 65_536


def check_output_file(path: Path | None, option: str = "", *, make_folder: bool = False) -> None:
    """Refuse a file that cannot be written; one that is there is replaced in the end.

    Args:
        path: The file; None checks nothing.
        option: That it was typed with; empty for an argument.
        make_folder: Whether missing folders are made.
    """
    if path is None or _in_place(path):
        return
    if path.is_dir():
        refuse(f"{_typed(option)}{path} is a folder, not a file")
    if not make_folder and not path.absolute().parent.is_dir():
        refuse(f"{_typed(option)}there is no folder {path.parent} for {path.name}")
    _try_to_write(path, path.absolute().parent, option)


def check_output_folder(path: Path | None, option: str = "", *, new: bool = False) -> None:
    """Refuse a folder in which nothing can be written; missing ones are made in the end.

    Args:
        path: The folder; None checks nothing.
        option: That it was typed with; empty for an argument.
        new: Whether it must not be there yet.
    """
    if path is None:
        return
    if new and path.exists():
        refuse(f"{_typed(option)}{path} exists already; nothing is written over it")
    if path.exists() and not path.is_dir():
        refuse(f"{_typed(option)}{path} is not a folder")
    _try_to_write(path, path.absolute(), option)


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """Yield a place for a file or a folder, which takes its own place when the body has ended.

    An error or a signal in the body leaves nothing behind. Files of a folder that exists are
    replaced one by one.

    Args:
        path: Where the file or the folder belongs; folders above it are made.
    """
    if _in_place(path):
        yield path
        return
    stage: Path | None = None
    try:
        with interruptible():
            try:
                with uninterrupted():
                    folder = path.absolute().parent
                    folder.mkdir(parents=True, exist_ok=True)
                    stage = Path(tempfile.mkdtemp(UNFINISHED, f".{path.name}.", folder))
                yield stage / path.name
                with uninterrupted():
                    _move(stage / path.name, path)
            finally:
                with uninterrupted():
                    if stage is not None:
                        shutil.rmtree(stage)
    except OSError as error:
        refuse(f"cannot write {path}: {error.strerror or error}", FAILED)


def write_json(path: Path, content: object) -> None:
    """Write JSON."""
    with staged(path) as place:
        place.write_text(json_format.dumps(content, indent=1) + "\n", encoding="utf-8")


def _in_place(path: Path) -> bool:
    """Return whether a path is a device or a link, such as /dev/stdout, not to be replaced."""
    return path.is_symlink() or (path.exists() and not path.is_file() and not path.is_dir())


def _move(source: Path, target: Path) -> None:
    if source.is_dir() and target.is_dir():
        for item in source.iterdir():
            _move(item, target / item.name)
    else:
        os.replace(source, target)


def _typed(option: str) -> str:
    return f"{option}: " if option else ""


def _try_to_write(path: Path, folder: Path, option: str) -> None:
    """Write and remove a file in a folder, or in the nearest one above that exists."""
    while not folder.exists():
        folder = folder.parent
    try:
        with tempfile.TemporaryFile(dir=folder) as trial:
            trial.write(bytes(_TRIAL))
            trial.flush()
            os.fsync(trial.fileno())
    except OSError as error:
        refuse(f"{_typed(option)}cannot write {path}: {error.strerror or error}")
