"""`winding calibrate`: a camera file from photographs of a board."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from winding_cli.commands.camera.board import BoardOptions
from winding_cli.terminal.console import busy
from winding_cli.terminal.output_path import Force, check_output_file, staged
from winding_cli.terminal.record_options import Typed, with_options
from winding_cli.terminal.refusal import refuse, refused


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
