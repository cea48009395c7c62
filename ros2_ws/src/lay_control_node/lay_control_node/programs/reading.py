"""Which reader takes a program file: by its suffix, on its text."""

import math
from pathlib import Path

from lay_control_node.programs.gcode_reader import parse_gcode
from lay_control_node.programs.points import parse_csv
from lay_control_node.programs.yaml_reader import parse_yaml
from winding_core.lay.program import LayProgram, LayProgramError

MOST_BYTES = 10_000_000  # A program of a hundred thousand points takes a few megabytes


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


_READERS = {
    ".csv": parse_csv,
    ".yaml": parse_yaml,
    ".yml": parse_yaml,
    ".gcode": parse_gcode,
    ".nc": parse_gcode,
    ".ngc": parse_gcode,
}


def read_program(path: Path, *, radius: float) -> LayProgram:
    """Read a lay program: a table, YAML, or G-code of filament winding.

    Args:
        path: Its suffix selects the reader, see docs/lay-control.md.
        radius: Of the laid cable's centreline [m], for lengths of cable.

    Raises:
        LayProgramError: It cannot be read or used, in one sentence with the line.
        ValueError: The radius is not positive.
    """
    if not (math.isfinite(radius) and radius > 0.0):
        raise ValueError(f"radius must be positive and finite, got {radius} m")
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise LayProgramError(
            f"a lay program ends in {', '.join(_READERS)}, got {path.name[-40:]!r}"
        )
    return reader(read_text(path), radius=radius, name=path.name)
