"""`winding board`: the calibration board to print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from winding_cli.commands.board_options import chosen_board
from winding_cli.commands.output_path import check_output_file, staged
from winding_cli.commands.refusal import refused
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
