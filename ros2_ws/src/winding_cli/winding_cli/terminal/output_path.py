"""Where a command writes: checked before anything starts, there whole in the end or not at all."""

import json as json_format
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, TextIO

import typer

from winding_cli.terminal.refusal import FAILED, refuse
from winding_cli.terminal.termination import interruptible, uninterrupted

UNFINISHED = ".unfinished"
# In place of a file of JSON.
STANDARD_OUTPUT = Path("-")
Force = Annotated[bool, typer.Option("--force", help="Replace output files that are there.")]
Json = Annotated[
    Path | None,
    typer.Option("--json", help="Also write the result as JSON: a file, or - for stdout."),
]
# What a trial writes [bytes]: a full disk may still have room for a name.
_TRIAL = 65_536
_REPLACED = {None: "nothing is written over it", False: "--force replaces it"}
_results: ContextVar[TextIO] = ContextVar("results")


def check_output_file(
    path: Path | None, option: str = "", *, make_folder: bool = False, force: bool | None = None
) -> None:
    """Refuse a file that cannot be written, or that is there already.

    With `STANDARD_OUTPUT` as the file of JSON everything else that the command prints goes to
    standard error from here on.

    Args:
        path: The file; None checks nothing.
        option: That it was typed with; empty for an argument.
        make_folder: Whether missing folders are made.
        force: Whether a file that is there is replaced in the end; None where that is no option.
    """
    if path == STANDARD_OUTPUT:
        if option != "--json":
            refuse(f"{_typed(option)}- is for --json; give a file")
        print_aside()
        return
    if path is None:
        return
    if path.is_dir():
        refuse(f"{_typed(option)}{path} is a folder, not a file")
    # What the shell redirects is a file, too.
    if path.is_file() and not force and Path("/dev") not in path.parents:
        refuse(f"{_typed(option)}{path} exists already; {_REPLACED[force]}")
    if _in_place(path):
        return
    if not make_folder and not path.absolute().parent.is_dir():
        refuse(f"{_typed(option)}there is no folder {path.parent} for {path.name}")
    _try_to_write(path, path.absolute().parent, option)


def check_output_folder(
    path: Path | None, option: str = "", *, new: bool = False, force: bool | None = None
) -> None:
    """Refuse a folder in which nothing can be written; missing ones are made in the end.

    Args:
        path: The folder; None checks nothing.
        option: That it was typed with; empty for an argument.
        new: Whether it must not be there yet.
        force: Whether files in it may be replaced by others of their names; if not, it must be
            empty. None asks for neither: what is written there is written beside what is there.
    """
    if path is None:
        return
    if new and path.exists():
        refuse(f"{_typed(option)}{path} exists already; {_REPLACED[None]}")
    if path.exists() and not path.is_dir():
        refuse(f"{_typed(option)}{path} is not a folder")
    if force is False and path.exists() and any(path.iterdir()):
        refuse(f"{_typed(option)}{path} holds files already; {_REPLACED[force]}")
    _try_to_write(path, path.absolute(), option)


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """Yield a place as `staging` does; a disk that takes no more ends the command."""
    try:
        with staging(path) as place:
            yield place
    except OSError as error:
        refuse(f"cannot write {path}: {error.strerror or error}", FAILED)


@contextmanager
def staging(path: Path) -> Iterator[Path]:
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


def print_aside() -> None:
    """Print on standard error from here on: standard output is for JSON alone."""
    # For the rest of the process, which is the command's.
    _results.set(sys.stdout)
    sys.stdout = sys.stderr


def write_text(path: Path | None, text: str) -> None:
    """Write a text into a file; None writes nothing."""
    if path is not None:
        with staged(path) as place:
            place.write_text(text, encoding="utf-8")


def write_json(path: Path | None, content: object) -> None:
    """Write JSON into a file, or to standard output; None writes nothing."""
    if path is None:
        return
    text = json_format.dumps(content, indent=1)
    if path == STANDARD_OUTPUT:
        print(text, file=_results.get(sys.stdout), flush=True)
    else:
        write_text(path, text + "\n")


def by_suffix(files: Iterable[Path], given: Mapping[str, Path | None]) -> list[Path | None]:
    """Return the files of a command, some typed with `--output`, whose names end as their kind.

    Args:
        files: Typed with `--output`.
        given: Ending, or several with spaces between -> file typed with an option of its own.

    Returns:
        A file for each item of `given`.
    """
    found = dict(given)
    for file in files:
        kind = next((kind for kind in given if file.suffix.lower() in kind.split()), None)
        if kind is None:
            refuse(f"--output must end in one of {' '.join(given)}, got {file}")
        if found[kind] is not None:
            refuse(f"--output: two files for {kind}, {found[kind]} and {file}")
        found[kind] = file
    return list(found.values())


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
