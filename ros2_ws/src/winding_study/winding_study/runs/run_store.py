"""Results of runs on disk, each under a key of its inputs: what is there is not computed again.

Any number of processes may share a store. A run is one file, written whole and renamed, so a
killed process leaves at most an unfinished file that nobody reads.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_study.runs.whole_file import UNFINISHED, write_whole

# Name inside a file for the key that it was written under.
KEY = "run_key"

Arrays = dict[str, NDArray[Any]]


def run_key(inputs: object, version: str) -> str:
    """Return the key of a run: SHA-256 over its inputs and the solver's version, 64 digits.

    Args:
        inputs: Dataclasses, mappings with text keys, sequences, text, numbers and None, nested
            at will. The order of keys does not count; a dataclass counts with its name.
        version: Version of what computes the run, as of `solver_version`.

    Raises:
        TypeError: An input has no canonical form.
        ValueError: A number is not finite.
    """
    content = {"inputs": canonical(inputs), "version": version}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def canonical(value: object) -> Any:
    """Return a value as plain JSON content that is the same for the same inputs.

    Raises:
        TypeError: The value has no canonical form.
        ValueError: A number is not finite.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        if not math.isfinite(value):
            raise ValueError(f"an input of a run must be finite, got {value}")
        return float(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {item.name: getattr(value, item.name) for item in dataclasses.fields(value)}
        return {"is": type(value).__qualname__, **canonical(fields)}
    if isinstance(value, Mapping):
        if not all(isinstance(name, str) for name in value):
            raise TypeError(f"names of a run's inputs must be text, got {sorted(value, key=str)}")
        return {name: canonical(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return canonical(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return [canonical(item) for item in value]
    raise TypeError(f"an input of a run must be numbers and text, got a {type(value).__name__}")


class RunStore:
    """A folder of finished runs, one npz file each, spread over 256 subfolders."""

    def __init__(self, folder: Path) -> None:
        """Use a folder, made when the first run is saved."""
        self.folder = folder

    def path(self, key: str) -> Path:
        """Return where a run's file belongs.

        Raises:
            ValueError: The key is not 64 hexadecimal digits.
        """
        if len(key) != 64 or not set(key) <= set("0123456789abcdef"):
            raise ValueError(f"a run's key must be 64 hexadecimal digits, got {key!r}")
        return self.folder / key[:2] / f"{key}.npz"

    def save(self, key: str, arrays: Mapping[str, ArrayLike]) -> None:
        """Keep a run's results; a run that is there already is replaced.

        Args:
            key: The run's key.
            arrays: Numbers and text by name, of any shape.

        Raises:
            ValueError: A result is neither number nor text, or its name is taken.
            OSError: The folder cannot be written.
        """
        path = self.path(key)
        content: Arrays = {name: np.asarray(value) for name, value in arrays.items()}
        for name, array in content.items():
            if array.dtype.hasobject:
                raise ValueError(f"result {name} of a run must be numbers or text")
        if KEY in content:
            raise ValueError(f"a run has no room for a result named {KEY}")
        content[KEY] = np.asarray(key)

        def write(file: BinaryIO) -> None:
            # Typed as if a result could be named like NumPy's own option allow_pickle.
            np.savez(file, **content)  # type: ignore[arg-type]

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
