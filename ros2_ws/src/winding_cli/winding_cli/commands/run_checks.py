"""What `winding run` refuses before any of its nodes starts."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.commands.condition_options import Typed, spelled
from winding_cli.commands.output_path import check_output_folder
from winding_cli.commands.refusal import refuse
from winding_core.marker_parameters import MarkerLook
from winding_core.options import options, typed_values
from winding_core.parameters import Value, build
from winding_core.units import MEGABYTE

if TYPE_CHECKING:
    from winding_recorder.bags.mcap_file import BagConfig
    from winding_supervisor.machine.external_machine import ExternalMachineConfig
    from winding_supervisor.session.run_config import RunConfig


def given(**values: object) -> dict[str, object]:
    """Return what was said, without what was left open."""
    return {name: value for name, value in values.items() if value is not None}


def case_label(case: int) -> str:
    """Return what a run's folder is called after; 0 is an own condition."""
    return f"case{case:02d}" if case else "own"


def look_of(typed: Typed) -> dict[str, Value]:
    """Return the parameters of how markers look, for the rig's camera and for the tracker.

    Raises:
        ParameterError: They name no colours, or such as are too much alike.
    """
    names = options(MarkerLook)
    values = typed_values(MarkerLook, {k: v for k, v in typed.items() if k in names}, spelled)
    _ = build(MarkerLook, values, owner="winding run").hues
    return values


def check_camera(
    *,
    external: bool,
    camera: bool,
    composed: bool,
    frame_rate: int | None,
    pixels: Typed,
    others: Iterable[Typed],
) -> None:
    """Refuse a frame rate that there is not, and what is told of a camera that there is not.

    Args:
        external: Whether the machine is somebody else's.
        camera: Whether it has one.
        composed: Whether frames come from a real camera's process.
        frame_rate: Of the simulated camera.
        pixels: What was typed of how a real camera's pixels are read.
        others: What else was typed of camera and tracker.
    """
    if frame_rate not in (None, 200, 1000):
        refuse(f"--frame-rate must be 200 or 1000, got {frame_rate}")
    if pixels and not (external or composed):
        refuse(f"{_listed(pixels)} for the pictures of a real camera, not the simulated one's")
    told = [key for typed in (pixels, *others) for key in typed]
    if told and not camera:
        refuse(f"{_listed(told, 'need', 'needs')} a camera")


def _listed(keys: Iterable[str], many: str = "are", one: str = "is") -> str:
    words = [spelled(key) for key in keys]
    if len(words) == 1:
        return f"{words[0]} {one}"
    return f"{', '.join(words[:-1])} and {words[-1]} {many}"


def check_page_and_file(page: bool, port: int | None, parameters: Path | None) -> None:
    """Refuse a page's port without a page, and a parameter file that there is not."""
    if port is not None and not page:
        refuse("--dashboard-port is for a run with --dashboard")
    if parameters is not None and not parameters.is_file():
        refuse(f"--parameters: there is no file {parameters}")


def lay_of(
    wanted: str | None, *, published: bool, composed: bool, wish: Mapping[str, Value]
) -> str:
    """Return where the cable shall lie; refuse what nobody published or what is not shown.

    Args:
        wanted: What was typed.
        published: Whether the paper measured it.
        composed: Whether the camera runs in the tracker's process.
        wish: Of the wanted lay, where it is controlled.
    """
    if wanted not in (None, "driven") and wish.get("control") == "drive":
        refuse(f"--control drive moves the cable, and --lay {wanted} does not: use --lay driven")
    lay = wanted or ("driven" if wish else "paper" if published else "fem")
    if lay == "driven" and composed:
        refuse("--lay driven is shown by the rig's own camera alone: leave out --compose")
    if lay == "paper" and not published:
        refuse("--lay paper is what the paper measured of cases 1 to 12; use --lay fem")
    return lay


def recording_of(compression: str, split_mb: float) -> BagConfig:
    """Return how a bag is stored; refuse what no bag can be."""
    from winding_recorder.bags.mcap_file import BagConfig

    if not 0.0 <= split_mb < math.inf:
        refuse(f"--split-mb must be finite and not negative, got {split_mb:g}")
    try:
        return BagConfig(compression=compression, split_bytes=round(split_mb * MEGABYTE))
    except ValueError as error:
        refuse(error)


def composed_camera(
    wanted: str | None,
    machine: ExternalMachineConfig | None,
    *,
    attach: bool,
    secure: bool,
) -> str:
    """Return what opens a camera in the tracker's process; empty for one that publishes.

    Args:
        wanted: What was typed: camera for the simulated one, or a camera source.
        machine: The external machine; None for the simulated one.
        attach: Whether somebody else runs the nodes.
        secure: Whether they are held to their policies.
    """
    if wanted is None:
        return ""
    from winding_core.camera_source import CameraSource, CameraSourceError

    if attach:
        refuse("with --attach somebody else runs the tracker: compose its camera there")
    if secure:
        refuse("--compose and --secure exclude each other: no policy lets the tracker show frames")
    if machine is None:
        if wanted != "camera":
            refuse("the simulated machine has a camera of its own: --compose camera")
        from winding_ros.graph import SIMULATED_CAMERA

        return SIMULATED_CAMERA
    if not machine.camera:
        refuse("--compose and --no-camera exclude each other")
    if wanted == "camera":
        refuse(
            "--compose camera is for the simulated machine; say what opens yours, "
            "MODULE:FUNCTION or FILE.py:FUNCTION"
        )
    # The tracker's process finds modules in the present folder, as `python -m` does.
    sys.path.append(str(Path.cwd()))
    try:
        CameraSource.parsed(wanted)
    except CameraSourceError as error:
        refuse(error)
    return wanted


def check_before_start(config: RunConfig) -> None:
    """Refuse what would end the run after its nodes have started."""
    from winding_supervisor.session.run_config import check_run

    try:
        check_run(config)
    except ValueError as error:
        refuse(error)
    _check_weights(config)
    check_output_folder(config.bag, "--bag", new=True)
    check_output_folder(config.directory, "--output", new=not config.numbered)


def _check_weights(config: RunConfig) -> None:
    from correction_node.models.weights import load_factor, weights_directory
    from winding_ros import topics

    name = config.parameters()[topics.CORRECTION].get("weights")
    if name:
        try:
            load_factor(weights_directory(str(name)))
        except (OSError, ValueError) as error:
            refuse(error)
