"""A file that is there whole or not at all: written beside its place, then renamed."""

from __future__ import annotations

import os
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

UNFINISHED = ".unfinished"


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
