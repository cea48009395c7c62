"""Results of runs on disk, each under a key of its inputs: what is there is not computed again.

Any number of processes may share a store. A run is one npz file, written whole and renamed, so a
killed process leaves at most an unfinished file, which is never read.

`joblib.Memory` keeps pickles, which run code when they are read, under hashes of pickles, which
differ between versions of Python. A store may be a folder that several machines share: it holds
numbers and text only, under keys that every machine computes alike. A key holds a digest of the
sources that a prediction may use, so a changed solver finds none of the runs of another.
"""

import dataclasses
import hashlib
import json
import os
import uuid
import zipfile
import zlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

import cable_fem_node
import winding_core

UNFINISHED = ".unfinished"
# Name inside a file for the key that it was written under.
KEY = "run_key"
Arrays = dict[str, NDArray[Any]]
PACKAGES = (cable_fem_node, winding_core)
_OUTSIDE = {"ros", "node.py", "__main__.py"}  # The adapter to ROS decides none of a run's numbers


def write_whole(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a file so that no reader and no killed writer ever leaves half of it.

    Several processes may write the same path; the last one wins.

    Args:
        path: Where the file belongs; its folder must exist.
        write: Writes the content to an open binary file.

    Raises:
        OSError: The folder cannot be written.
    """
    beside = path.with_name(f".{path.name}.{uuid.uuid4().hex}{UNFINISHED}")
    try:
        with beside.open("xb") as file:
            write(file)
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def run_key(inputs: object, version: str) -> str:
    """Return the key of a run: SHA-256 over its inputs and the solver's version, 64 digits.

    Args:
        inputs: As `canonical_text` takes them.
        version: Version of what computes the run, as of `solver_version`.

    Raises:
        TypeError: An input has no canonical form.
        ValueError: A number is not finite.
    """
    text = canonical_text({"inputs": inputs, "version": version})
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def canonical_text(inputs: object) -> str:
    """Return inputs as JSON text that is the same for the same inputs.

    Args:
        inputs: Dataclasses, mappings with text keys, sequences, text, numbers and None, nested
            at will. The order of keys does not count; a dataclass counts with its name.

    Raises:
        TypeError: An input has no canonical form.
        ValueError: A number is not finite.
    """
    return json.dumps(inputs, default=_plain, sort_keys=True, allow_nan=False)


def _plain(value: object) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {item.name: getattr(value, item.name) for item in dataclasses.fields(value)}
        return {"is": type(value).__qualname__, **fields}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"an input of a run must be numbers and text, got a {type(value).__name__}")


class RunStore:
    """A folder of finished runs, one npz file each, spread over 256 subfolders."""

    def __init__(self, folder: Path) -> None:
        """Use a folder, made when the first run is saved."""
        self.folder = folder

    def path(self, key: str) -> Path:
        """Return where the file of a run with this `run_key` belongs."""
        return self.folder / key[:2] / f"{key}.npz"

    def save(self, key: str, arrays: Mapping[str, ArrayLike]) -> None:
        """Keep a run's results; a run that is there already is replaced.

        Args:
            key: The run's key.
            arrays: Numbers and text by name, of any shape.

        Raises:
            ValueError: A result is neither number nor text.
            OSError: The folder cannot be written.
        """
        content: dict[str, Any] = {**arrays, KEY: key}

        def write(file: BinaryIO) -> None:
            np.savez(file, allow_pickle=False, **content)

        path = self.path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, write)

    def load(self, key: str, say: Callable[[str], None]) -> Arrays | None:
        """Return a run's results, or None when they are not there or cannot be trusted.

        Args:
            key: The run's key.
            say: Called with one sentence when there is a file that cannot be used.
        """
        path = self.path(key)
        try:
            with np.load(path, allow_pickle=False) as file:
                # Reading checks the CRC of every member.
                content: Arrays = {name: file[name] for name in file.files}
        except FileNotFoundError:
            return None
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
            say(f"{path} is damaged and counts as missing: {error}")
            return None
        if str(content.pop(KEY, "")) != key:
            say(f"{path} holds another run and counts as missing")
            return None
        return content

    def remove_unfinished(self, before: float) -> int:
        """Delete what killed processes left half-written and return how many files that were.

        Args:
            before: Only files last written before this time [s since the epoch], since a
                younger one may still be written.
        """
        count = 0
        for path in self.folder.glob(f"??/.*{UNFINISHED}"):
            try:
                if path.stat().st_mtime < before:
                    path.unlink()
                    count += 1
            except FileNotFoundError:
                continue
        return count


def solver_sources() -> dict[str, Path]:
    """Return the files that may decide a run's numbers, by place in their package, in order."""
    return {
        f"{package.__name__}/{path.relative_to(folder).as_posix()}": path
        for package in PACKAGES
        for folder in [Path(str(package.__file__)).parent]
        for path in sorted(folder.rglob("*.py"))
        if path.relative_to(folder).parts[0] not in _OUTSIDE
    }


@cache
def solver_version() -> str:
    """Return 16 digits that change when the solver's sources change, the same on every machine.

    Versions of NumPy and Numba do not count: they move results by rounding only.
    """
    digest = hashlib.sha256()
    for name, path in solver_sources().items():
        digest.update(f"{name}\0".encode())
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()[:16]
