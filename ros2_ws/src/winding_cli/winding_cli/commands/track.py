"""`winding track`: measure the markers of a recorded run, without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from winding_cli.commands.condition_options import Typed, spelled, with_options
from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import check_output_file, staged
from winding_cli.commands.refusal import FAILED, refuse, refused
from winding_core.camera_clock import CameraClockParameters
from winding_core.condition import Condition, ResolvedCondition
from winding_core.options import typed_values
from winding_core.parameters import build
from winding_core.readings import AxisReading
from winding_core.units import MILLIMETRE, MILLIRADIAN

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from marker_tracker_node import (
        PinholeCamera,
        PoseBelief,
        Refinement,
        Tracker,
        TrackerConfig,
    )
    from marker_tracker_node.camera.recordings import Motion
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker
    from winding_core.markers import Markers

    Frames = Iterator[tuple[float, NDArray[np.uint8]]]

BAGS = (".mcap", ".db3", ".bag")


@with_options(Condition, CameraClockParameters)
def track(
    typed: Typed,
    clock: Typed,
    *,
    source: Annotated[Path, typer.Argument(help="Video file, folder of pictures, or bag.")],
    out: Annotated[Path, typer.Option(help="CSV of every frame's markers.")],
    camera: Annotated[
        Path | None, typer.Option(help="Camera YAML; a bag may bring its own camera_info.")
    ] = None,
    motion: Annotated[
        Path | None,
        typer.Option(help="CSV t, cylinder_angle, guide_z; a bag may bring joint_states."),
    ] = None,
    band_mm: Annotated[float, typer.Option(help="Width of a marker along the cable.")] = 6.0,
    camera_position_mm: Annotated[
        str,
        typer.Option(help="Camera: across, up, along the axis. A run refines it."),
    ] = "417.5,0,50",
    fps: Annotated[float | None, typer.Option(help="Of pictures without times.")] = None,
    refined: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Fit the camera's pose over the run.")
    ] = True,
    camera_position_sigma_mm: Annotated[
        float,
        typer.Option(min=0.0, help="Standard deviation of its position; a tape measure's."),
    ] = 2.0,
    camera_tilt_sigma_mrad: Annotated[
        float,
        typer.Option(min=0.0, help="Standard deviation of its direction; a spirit level's."),
    ] = 10.0,
) -> None:
    """Track a recording and print where every marker lies."""
    from marker_tracker_node import PoseBelief, Tracker
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.recordings import (
        Recording,
        read_bag,
        read_motion,
        write_measurements,
    )
    from marker_tracker_node.tracking.camera_clock import ClockSettings
    from marker_tracker_node.tracking.encoder_history import EncoderHistory
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker

    if not source.exists():
        refuse(f"{source} does not exist")
    check_output_file(out)
    with refused(OSError, ValueError):
        wound = Condition.from_typed(typed, spelling=spelled, case=Condition.case)
        config = _config(wound.resolved(), band_mm, camera_position_mm)
        bag = _is_bag(source)
        brought = read_bag(source) if bag else Recording(camera=None, motion=None)
        lens = read_camera(camera) if camera else brought.camera
        drive = read_motion(motion) if motion else brought.motion
        if lens is None:
            refuse("there is no camera: give --camera")
        if drive is None:
            refuse("there is no motion: give --motion")
        wanted = build(
            CameraClockParameters,
            typed_values(CameraClockParameters, clock, spelled),
            owner="the camera's clock",
        )
        settings = ClockSettings(
            correct=wanted.camera_clock_correction, limit=wanted.camera_clock_limit
        )
        live = SynchronisedTracker(settings, EncoderHistory(longest_gap=math.inf, complete=True))
        tracker = Tracker(config, lens, remember=refined)
        live.start(tracker)
        rows = list(_measure(live, _frames(source, bag, fps), drive, settings.limit))
    with staged(out) as place:
        write_measurements(place, rows)
    belief = PoseBelief(
        position=camera_position_sigma_mm * MILLIMETRE, tilt=camera_tilt_sigma_mrad * MILLIRADIAN
    )
    _print(tracker, lens, belief if refined else None)
    _print_clock(live)
    report = tracker.report()
    if not report.known:
        refuse(f"no marker was found: {report.colour_refusal or 'nothing moved with P0'}", FAILED)


def _config(what: ResolvedCondition, band_mm: float, camera_position_mm: str) -> TrackerConfig:
    from marker_tracker_node import CameraPose, TrackerConfig

    case = what.case
    return TrackerConfig(
        cylinder_radius=case.cylinder_radius,
        cable_radius=case.cable_radius,
        marker_spacing=case.marker_spacing,
        marker_count=case.marker_count,
        expected_stretch=case.expected_stretch,
        band_width=band_mm * MILLIMETRE,
        pose=CameraPose(position=_position(camera_position_mm)),
    )


def _position(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(word) * MILLIMETRE for word in text.split(","))
    except ValueError:
        raise ValueError(f"--camera-position-mm needs three numbers, got {text!r}") from None
    return x, y, z


def _is_bag(source: Path) -> bool:
    return source.suffix in BAGS or (source / "metadata.yaml").exists()


def _frames(source: Path, bag: bool, fps: float | None) -> Frames:
    from marker_tracker_node.camera.recordings import bag_frames, folder_frames, video_frames

    if bag:
        return bag_frames(source)
    if source.is_dir():
        return folder_frames(source, fps)
    return video_frames(source, fps)


def _measure(
    live: SynchronisedTracker, frames: Frames, motion: Motion, ahead: float
) -> Iterator[tuple[float, Markers]]:
    """Yield the markers of every frame; readings come as far ahead of it as clocks may differ."""
    readings = deque(zip(motion.t, motion.cylinder_angle, motion.guide_z, strict=True))
    for t, frame in frames:
        while readings and readings[0][0] <= t + ahead:
            at, angle, guide = readings.popleft()
            live.add_reading(
                at,
                AxisReading(
                    cylinder_angle=angle,
                    angular_speed=math.nan,
                    carriage_position=guide,
                    feed_speed=math.nan,
                ),
            )
        live.add_frame(t, frame)
        yield from live.measured(final=True)


def _print_clock(live: SynchronisedTracker) -> None:
    clock = live.clock
    if clock is None:
        return
    told = clock.values()
    console = result_console()
    console.print(
        f"camera clock: {told['camera_clock_offset_ms']} ms ahead of the encoder's, error "
        f"{told['camera_clock_offset_error_ms']} ms, "
        f"{'corrected' if clock.applied else 'not corrected'}"
    )
    for sentence in filter(None, (clock.refusal, clock.warning)):
        console.print(sentence)


def _print(tracker: Tracker, lens: PinholeCamera, belief: PoseBelief | None) -> None:
    """Print where every marker lies; with a belief in the camera's pose, refined beside that."""
    from marker_tracker_node import refine

    console = result_console()
    report = tracker.report()
    refused = sum(report.rejected.values())
    console.print(f"{report.frames} frames used, {refused} refused, {report.known} markers known")
    for fault, count in report.rejected.items():
        if count:
            console.print(f"  {count} x {fault.value}")
    for doubt in report.doubts:
        console.print(doubt)
    table = Table("marker")
    estimates = tracker.estimates()
    columns = _columns(table, tracker, "", *(estimates[name] for name in _NUMBERS))
    if belief is not None:
        try:
            fit = refine(tracker.config, lens, tracker.sightings(), belief)
        except ValueError as error:
            console.print(f"not refined: {error}")
        else:
            console.print(f"refined: {fit.residual:.2f} px, {_pose_change(fit)}")
            columns += _columns(
                table, tracker, "refined ", fit.theta, fit.z, fit.sigma_theta, fit.sigma_z
            )
    for n, cells in enumerate(zip(*columns, strict=True)):
        table.add_row(f"P{n}", *cells)
    console.print(table)


_NUMBERS = ("theta", "z", "sigma_theta", "sigma_z")


def _columns(
    table: Table,
    tracker: Tracker,
    what: str,
    theta: NDArray[np.float64],
    z: NDArray[np.float64],
    sigma_theta: NDArray[np.float64],
    sigma_z: NDArray[np.float64],
) -> list[list[str]]:
    """Add the headings of theta, z and S to a table and return the cells of each column."""
    from winding_core.helix import curve_length

    for heading in ("theta, rad", "z, mm", "S, mm"):
        table.add_column(what + heading)
    length = curve_length(tracker.config.centreline_radius, theta, z)
    known = [math.isfinite(s) for s in length]
    cells = (
        [f"{a:.4f} ± {d:.4f}" for a, d in zip(theta, sigma_theta, strict=True)],
        [f"{a / MILLIMETRE:.3f} ± {d / MILLIMETRE:.3f}" for a, d in zip(z, sigma_z, strict=True)],
        [f"{s / MILLIMETRE:.2f}" for s in length],
    )
    return [
        [cell if told else "-" for cell, told in zip(column, known, strict=True)]
        for column in cells
    ]


def _pose_change(fit: Refinement) -> str:
    """Return how far the camera was moved, with standard deviations."""
    parts = [
        ", ".join(
            f"{change / unit:.2f} ± {sigma / unit:.2f}"
            for change, sigma in zip(fit.moved[axes], fit.sigma_pose[axes], strict=True)
        )
        for axes, unit in ((slice(0, 3), MILLIRADIAN), (slice(3, 6), MILLIMETRE))
    ]
    return f"camera turned by ({parts[0]}) mrad, moved by ({parts[1]}) mm"
