"""Lay programs as a table: one point in a row, units in the head line."""

from __future__ import annotations

import csv
import io

from lay_control_node.programs.points import Columns, PointList
from winding_core.lay.program import LayProgram, LayProgramError


def parse_csv(text: str, *, radius: float, name: str) -> LayProgram:
    """Read a table.

    Args:
        text: Head line and rows; lines that are empty or begin with # say nothing.
        radius: Of the laid cable's centreline [m].
        name: Of the program.

    Raises:
        LayProgramError: It cannot be used; says the line.
    """
    points = PointList(radius=radius)
    columns: Columns | None = None
    head: list[str] = []
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
                continue
            place = f"line {reader.line_num} of {name}"
            if columns is None:
                head = [cell.strip() for cell in cells]
                if len(head) == 1 and ";" in head[0]:
                    raise LayProgramError(f"{place} parts its columns with ;, commas are read")
                if len(set(head)) < len(head):
                    raise LayProgramError(f"{place} names a column twice: {', '.join(head)[:80]}")
                columns = Columns.of(head, place)
                continue
            if len(cells) != len(head):
                raise LayProgramError(
                    f"{place} has {len(cells)} cells, the head line has {len(head)}"
                )
            points.add_row(columns, dict(zip(head, cells, strict=True)), place)
    except csv.Error as error:
        raise LayProgramError(f"line {reader.line_num} of {name}: {error}") from error
    return points.program(name)
