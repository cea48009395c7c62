"""A program file by its suffix."""

from __future__ import annotations

import math
from pathlib import Path

from lay_control_node.programs.csv_reader import parse_csv
from lay_control_node.programs.gcode_reader import parse_gcode
from lay_control_node.programs.text_file import read_text
from lay_control_node.programs.yaml_reader import parse_yaml
from winding_core.lay.program import LayProgram, LayProgramError

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
        path: Its suffix says which, see docs/lay-control.md.
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
