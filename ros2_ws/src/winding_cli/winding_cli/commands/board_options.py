"""The calibration board that options describe."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from winding_cli.commands.refusal import refuse, refused
from winding_core.units import MILLIMETRE

if TYPE_CHECKING:
    from marker_tracker_node.camera.calibration import Board


def chosen_board(
    columns: int, rows: int, square_mm: float, marker_mm: float, dictionary: str
) -> Board:
    """Return the board; end the command where there is none of that kind.

    Args:
        columns: Squares across.
        rows: Squares down.
        square_mm: Side of a square [mm].
        marker_mm: Side of a ChArUco marker [mm]; 0 for a plain chessboard.
        dictionary: Of the markers.
    """
    from marker_tracker_node.camera.calibration import Board

    for option, count in (("--columns", columns), ("--rows", rows)):
        if count < 3:
            refuse(f"{option} must be 3 or more, got {count}")
    if not (math.isfinite(square_mm) and square_mm > 0.0):
        refuse(f"--square-mm must be positive and finite, got {square_mm:g}")
    if not 0.0 <= marker_mm < square_mm:
        refuse(f"--marker-mm must lie in 0 to --square-mm, {square_mm:g}, got {marker_mm:g}")
    with refused(ValueError):
        return Board(
            columns=columns,
            rows=rows,
            square=square_mm * MILLIMETRE,
            marker=marker_mm * MILLIMETRE if marker_mm else None,
            dictionary=dictionary,
        )
