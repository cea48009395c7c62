"""`winding track`: measure the markers of a recorded run, without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.table import Table

from winding_cli.commands.condition_options import Typed, spelled, with_options
from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import check_output_file, staged
from winding_cli.commands.refusal import FAILED, refuse, refused
from winding_core.camera_clock import CameraClockParameters
from winding_core.camera_pixels import CameraPixels
from winding_core.camera_placement import CameraPlacement
from winding_core.condition import Condition
from winding_core.image_formats import PixelReader
from winding_core.marker_parameters import MarkerParameters
from winding_core.options import typed_values
from winding_core.parameters import build
from winding_core.readings import AxisReading
from winding_core.units import MILLIMETRE, MILLIRADIAN

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from marker_tracker_node import (
        LayReport,
        PinholeCamera,
        PoseBelief,
        Refinement,
        Tracker,
    )
    from marker_tracker_node.camera.recordings import Motion
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker
    from winding_core.markers import Markers

Record = TypeVar("Record")


@with_options(Condition, CameraClockParameters, CameraPlacement, MarkerParameters, CameraPixels)
def track(
    typed: Typed,
    clock: Typed,
    placement: Typed,
    markers: Typed,
    pixels: Typed,
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
    fps: Annotated[
        float | None,
        typer.Option(help="Of pictures without times; of a video in place of its own times."),
    ] = None,
    lay: Annotated[
        Path | None, typer.Option(help="CSV of every turn on the cylinder, every 5 degrees.")
    ] = None,
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
    from marker_tracker_node.camera.bags import Recording, is_bag, read_bag
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.frame_sources import FrameSource
    from marker_tracker_node.camera.recordings import read_motion, write_measurements
    from marker_tracker_node.lay.lay_follower import LayFollower, write_lay
    from marker_tracker_node.tracking.camera_clock import ClockSettings
    from marker_tracker_node.tracking.config import TrackerConfig
    from marker_tracker_node.tracking.encoder_history import EncoderHistory
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker

    if not source.exists():
        refuse(f"{source} does not exist")
    check_output_file(out)
    if lay is not None:
        check_output_file(lay)
    with refused(OSError, ValueError):
        wound = Condition.from_typed(typed, spelling=spelled, case=Condition.case)
        where = _built(CameraPlacement, placement)
        sought, read = _built(MarkerParameters, markers), _built(CameraPixels, pixels)
        config = TrackerConfig.of(wound.resolved(), where, sought, row_time=read.row_time)
        brought = read_bag(source) if is_bag(source) else Recording(camera=None, motion=None)
        lens = read_camera(camera) if camera else brought.camera
        drive = read_motion(motion) if motion else brought.motion
        if lens is None:
            refuse("there is no camera: give --camera")
        if drive is None:
            refuse("there is no motion: give --motion")
        wanted = _built(CameraClockParameters, clock)
        settings = ClockSettings(
            correct=wanted.camera_clock_correction, limit=wanted.camera_clock_limit
        )
        follower = LayFollower()
        live = SynchronisedTracker(
            settings,
            EncoderHistory(longest_gap=math.inf, complete=True),
            beside=follower.take if lay is not None else None,
        )
        tracker = Tracker(config, lens, remember=refined)
        live.start(tracker)
        reader = PixelReader(encoding=read.encoding, significant_bits=read.significant_bits)
        frames = FrameSource(source, fps=fps, reader=reader)
        rows = list(_measure(live, frames, drive, settings.limit))
    with staged(out) as place:
        write_measurements(place, rows)
    if lay is not None and follower.lay is not None:
        with staged(lay) as place:
            write_lay(place, follower.lay.report())
    for sentence in (*frames.remarks(), *tracker.report().remarks):
        result_console().print(sentence, soft_wrap=True)
    belief = PoseBelief(
        position=camera_position_sigma_mm * MILLIMETRE, tilt=camera_tilt_sigma_mrad * MILLIRADIAN
    )
    _print(tracker, lens, belief if refined else None)
    _print_clock(live)
    if follower.lay is not None:
        _print_lay(follower.lay.report())
    report = tracker.report()
    if not report.known:
        refuse(f"no marker was found: {report.colour_refusal or 'nothing moved with P0'}", FAILED)


def _built(record: type[Record], typed: Typed) -> Record:
    return build(record, typed_values(record, typed, spelled), owner="winding track")


def _measure(
    live: SynchronisedTracker,
    frames: Iterable[tuple[float, NDArray[np.uint8]]],
    motion: Motion,
    ahead: float,
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


def _print_lay(report: LayReport) -> None:
    from winding_core.lay_records import name_of

    console, records = result_console(), report.records
    turns = len(set(records["turn"].tolist()))
    console.print(f"lay: {len(records)} places of {turns} turns")
    if math.isfinite(report.free_length):
        length, error = (x / MILLIMETRE for x in (report.free_length, report.sigma_free_length))
        console.print(f"free length: {length:.1f} mm, error {error:.1f} mm")
    for defect in report.defects:
        where = f"{defect.first:.2f} to {defect.last:.2f} rad"
        console.print(f"{name_of(defect.flag)}: {where}", soft_wrap=True)


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
    for item in report.contradictions:
        console.print(f"the pictures contradict: {item.sentence}")
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
