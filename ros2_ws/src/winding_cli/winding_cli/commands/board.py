"""`winding board`: the calibration board to print."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.terminal.output_path import check_output_file, staged
from winding_cli.terminal.refusal import refuse, refused
from winding_core.units import MILLIMETRE


def board(
    out: Annotated[Path, typer.Argument(help="Picture to write, such as board.png.")],
    *,
    columns: Annotated[int, typer.Option(help="Squares across.")] = 14,
    rows: Annotated[int, typer.Option(help="Squares down.")] = 8,
    square_mm: Annotated[float, typer.Option(help="Side of a square.")] = 8.0,
    marker_mm: Annotated[
        float, typer.Option(help="Side of a ChArUco marker; 0 for a plain chessboard.")
    ] = 6.0,
    dictionary: Annotated[str, typer.Option(help="Of the markers.")] = "DICT_4X4_250",
    dpi: Annotated[float, typer.Option(min=50.0, max=2400.0, help="Dots per inch.")] = 600.0,
) -> None:
    """Draw the board that `winding calibrate` looks for; print it at its true size."""
    from marker_tracker_node.camera.calibration import write_board

    check_output_file(out)
    with refused(ValueError):
        drawn = chosen_board(columns, rows, square_mm, marker_mm, dictionary)
        with staged(out) as place:
            width, height = write_board(place, drawn, dpi)
    print(
        f"{out}: print at {dpi:g} dots per inch, {width / MILLIMETRE:.1f} x "
        f"{height / MILLIMETRE:.1f} mm, and measure a square before you trust it"
    )


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
