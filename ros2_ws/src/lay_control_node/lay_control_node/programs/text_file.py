"""The text of a program file, or one sentence why there is none."""

from __future__ import annotations

from pathlib import Path

from winding_core.lay.program import LayProgramError

# A program of a hundred thousand points takes a few megabytes.
MOST_BYTES = 10_000_000


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        LayProgramError: It cannot be read, is too large, is empty or is no UTF-8.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise LayProgramError(f"cannot read {path}: {reason}") from error
    if len(content) > MOST_BYTES:
        raise LayProgramError(f"{path} is larger than {MOST_BYTES} bytes, the most of a program")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise LayProgramError(f"line {line} of {path} is no UTF-8 text") from error
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise LayProgramError(f"line {line} of {path} holds a zero byte: it is no text")
    if not text.strip():
        raise LayProgramError(f"{path} is empty")
    return text
