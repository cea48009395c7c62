"""`winding board`, `winding calibrate`: the board to print, a camera file from its pictures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.terminal.console import busy
from winding_cli.terminal.output_path import Force, check_output_file, staged
from winding_cli.terminal.record_options import Typed, spelled, with_options
from winding_cli.terminal.refusal import refuse, refused
from winding_core.parameters import build, parameter, typed_values
from winding_core.units import LENGTH, MILLIMETRE, PLAIN

if TYPE_CHECKING:
    from marker_tracker_node.camera.calibration import Board


@dataclass(frozen=True, kw_only=True)
class BoardOptions:
    """The calibration board, as it is typed."""

    columns: int = parameter(14, "squares across", PLAIN, 3, 100)
    rows: int = parameter(8, "squares down", PLAIN, 3, 100)
    square: float = parameter(8.0e-3, "side of a square", LENGTH, 1.0e-4, 1.0)
    marker: float = parameter(
        6.0e-3, "side of a ChArUco marker; 0 for a plain chessboard", LENGTH, 0.0, 1.0
    )
    dictionary: str = parameter("DICT_4X4_250", "dictionary of the markers", PLAIN)

    @staticmethod
    def board(typed: Typed) -> Board:
        """Return the board that was typed.

        Raises:
            ValueError: There is none of that kind.
        """
        from marker_tracker_node.camera.calibration import Board

        wanted = build(BoardOptions, typed_values(BoardOptions, typed, spelled), owner="the board")
        return Board(**{**vars(wanted), "marker": wanted.marker or None})


@with_options(BoardOptions)
def board(
    typed: Typed,
    *,
    out: Annotated[Path, typer.Argument(help="Picture to write, such as board.png.")],
    dpi: Annotated[float, typer.Option(min=50.0, max=2400.0, help="Dots per inch.")] = 600.0,
    force: Force = False,
) -> None:
    """Draw the board that `winding calibrate` looks for; print it at its true size."""
    from marker_tracker_node.camera.calibration import write_board

    check_output_file(out, force=force)
    with refused(ValueError):
        drawn = BoardOptions.board(typed)
        with staged(out) as place:
            width, height = write_board(place, drawn, dpi)
    print(
        f"{out}: print at {dpi:g} dots per inch, {width / MILLIMETRE:.1f} x "
        f"{height / MILLIMETRE:.1f} mm, and measure a square before you trust it"
    )


@with_options(BoardOptions)
def calibrate(
    typed: Typed,
    *,
    pictures: Annotated[list[Path], typer.Argument(help="Photographs, or folders of them.")],
    out: Annotated[Path, typer.Option("--output", "--out", help="Camera YAML to write.")],
    name: Annotated[str, typer.Option(help="Name of the camera.")] = "camera",
    force: Force = False,
) -> None:
    """Fit camera matrix and distortion, and write the YAML that ROS tools read."""
    from marker_tracker_node.camera.calibration import calibrate as fit
    from marker_tracker_node.camera.calibration import write_camera
    from marker_tracker_node.camera.recordings import PICTURES, read_picture

    files = [
        file
        for path in pictures
        for file in (sorted(path.iterdir()) if path.is_dir() else [path])
        if not path.is_dir() or file.suffix.lower() in PICTURES
    ]
    if not files:
        refuse("there is no picture")
    check_output_file(out, "--output", force=force)
    with refused(OSError, ValueError), busy("looking for boards", total=len(files)) as show:
        photographs = []
        for file in files:
            photographs.append(read_picture(file))
            show(advance=1)
        result = fit(photographs, BoardOptions.board(typed))
    with staged(out) as place:
        write_camera(place, result.camera, name)
    print(
        f"{result.views} views ({result.refused} without a board), residual "
        f"{result.residual:.3f} px, focal {result.camera.k[0, 0]:.2f} px, written to {out}"
    )
